"""What sensors share: the channel that a signal takes to a message, and noise that is counted."""
