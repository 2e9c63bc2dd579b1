"""References: the motion the driver asks for."""
