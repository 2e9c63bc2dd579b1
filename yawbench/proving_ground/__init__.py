"""Standard tests of vehicle dynamics: from recorded or measured signals to quantities and verdicts."""
