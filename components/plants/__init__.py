"""Plants: the car without its tyres."""
