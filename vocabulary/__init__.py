"""Definitions shared by components and the bench: plain data, copied into the FMUs that use it."""
