"""Components written in C: shared code, and their build."""
