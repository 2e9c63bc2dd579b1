"""Build of components written in C, and the C code that they share."""
