"""Standard tests of vehicle dynamics: from recorded or measured signals to quantities and verdicts.

`standard_tests` lists them with the functions that evaluate, draw and drive each; `handling` has the figures
of a car on a test track.
"""
