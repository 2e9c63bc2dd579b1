"""Stage one: a scenario file read strictly, every problem with its line."""
