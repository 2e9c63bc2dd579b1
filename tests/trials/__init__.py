"""Trials run on demand: what is too long for the tests, of which a sample runs there."""
