"""Building FMUs from components; the built *.fmu files are next to this file and not in git."""
