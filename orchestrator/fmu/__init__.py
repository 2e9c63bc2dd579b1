"""FMU archives: found, unpacked once, described, guarded against each other."""
