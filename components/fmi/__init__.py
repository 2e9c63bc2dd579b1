"""What declares a unit and speaks FMI for it."""
