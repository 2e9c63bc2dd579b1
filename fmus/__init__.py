"""Builder of FMUs from components; the *.fmu files are written next to this file and not kept in git."""
