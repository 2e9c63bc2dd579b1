"""FMU archives: located, unpacked into a cache, described, and checked for what the master supports."""
