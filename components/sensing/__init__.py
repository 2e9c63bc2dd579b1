"""Code shared by sensors: channels from signals to messages, parameters, noise."""
