"""Components written in C: their declaration, their build, and the headers that all C units share."""
