"""Definitions shared by components and the bench, copied into the FMUs that use them."""
