"""Other masters, each run in a process of its own: `python -m orchestrator.interop.masters NAME REQUEST`.

A master is a module with `drive(request)`, which runs an SSP archive and returns a Recording.
"""
