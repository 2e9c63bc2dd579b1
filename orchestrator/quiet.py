"""Silences tracebacks in the fork server, which imports this module, when its parent is killed.

Otherwise the server, and a process that has just been started, would each print a traceback of a broken
pipe. Runs report their own errors (see `experiments.workers`).
"""

import sys

sys.excepthook = lambda kind, error, trace: None
