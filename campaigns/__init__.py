"""Campaigns against the program, run on demand; the tests run samples of some."""
