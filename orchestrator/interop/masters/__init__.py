"""Other masters, each run in a process of its own.

A master is a module with `drive(request)`, which runs an SSP archive and returns a Recording.
"""
