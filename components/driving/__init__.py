"""Code shared by drivers: the pedal, the steering wheel, the track."""
