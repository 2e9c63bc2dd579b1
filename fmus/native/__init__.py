"""Translator of Python components to C by partial evaluation, and comparison of the result with Python."""
