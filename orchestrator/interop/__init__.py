"""Other programs: systems in the form of SSP, and the same scenario run by other masters."""
