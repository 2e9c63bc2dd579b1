"""Linear models of a scenario around an operating point."""
