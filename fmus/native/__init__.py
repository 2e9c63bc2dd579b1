"""Components in Python translated to C: read, evaluated in part, lowered, emitted, compiled, and checked."""
