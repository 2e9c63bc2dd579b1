"""Parts of cars: bodies, wheels, loads, resistance."""
