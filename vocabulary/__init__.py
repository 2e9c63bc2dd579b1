"""What units and the bench have to agree on: plain data, part of the FMUs that use it, importing nothing."""
