"""Code shared by sensors: the channel from a signal to a message, and counted noise."""
