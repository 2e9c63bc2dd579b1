"""Units written in C: what they share, and how they are built."""
