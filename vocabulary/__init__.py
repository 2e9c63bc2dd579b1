"""What units and the bench call things: plain data, part of every FMU, importing nothing."""
