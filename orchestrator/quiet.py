"""Keeps the server that starts processes, which imports this, quiet when its command is killed.

The server, and a process that has just been started, would each show a traceback of the pipe that broke. Runs
tell of their own errors (see `experiments.workers`).
"""

import sys

sys.excepthook = lambda kind, error, trace: None
