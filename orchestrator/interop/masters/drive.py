"""One master in this process, by its name."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

from .request import Request


def main(name: str, request_file: str, recording_file: str) -> None:
    """Run what the request says, write the recording; a reason why not goes to stderr."""
    request = Request.read(Path(request_file))
    if request.core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {request.core})
    try:
        module = importlib.import_module(f".{name}", __package__)
        module.drive(request).write(Path(recording_file))
    except Exception as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
    os._exit(0)  # some leave threads behind that never end
