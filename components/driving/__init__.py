"""What drivers share: the pedal, the steering wheel, the track."""
