"""Vehicle dynamics shared by plants: bodies, wheels, loads, resistance."""
