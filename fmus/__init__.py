"""How FMUs are built; the built *.fmu stand beside this file and are not in git."""
