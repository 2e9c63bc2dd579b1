"""Stage three: the units of a plan stepped through integer time."""
