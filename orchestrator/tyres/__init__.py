"""Tyre FMUs on a test stand."""
