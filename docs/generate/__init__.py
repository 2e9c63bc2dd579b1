"""Reference pages, each made from the part of the program it describes."""
