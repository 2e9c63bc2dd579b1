"""Programs on a terminal: what one prints there."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import subprocess
import termios
from collections.abc import Sequence
from typing import Any


def seen_on_terminal(
    command: Sequence[object], stream: str, size: tuple[int, int] = (24, 80), **options: Any
) -> str:
    """Return what a program prints to a terminal of so many lines and columns, which is one of its streams.

    Args:
        command: the program and its arguments; it has to end with status 0.
        stream: "stdout" or "stderr".
        size: lines and columns.
        options: of `subprocess.Popen`.
    """
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", *size, 0, 0))
    process = subprocess.Popen([str(part) for part in command], **{stream: theirs}, **options)
    os.close(theirs)
    read = b""
    try:
        while block := os.read(ours, 65536):
            read += block
    except OSError:  # the end of a terminal
        pass
    os.close(ours)
    assert process.wait() == 0
    return read.decode()
