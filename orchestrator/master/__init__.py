"""Co-simulation master: creates, initializes and steps the instances of a plan."""
