"""Where something is tried: in a child process, which may die of it, or in another folder."""

from __future__ import annotations

import json
import os
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def told_by(act: Callable[[Callable[..., None]], None]) -> tuple[list[Any], str]:
    """Call a function in a fork; return the news that it told, and the signal or error that ended it."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:

        def tell(*news: Any) -> None:
            os.write(writing, json.dumps(news).encode() + b"\n")

        try:
            os.close(reading)
            act(tell)
        except BaseException as error:
            traceback.print_exc()
            tell(None, f"{type(error).__name__}: {error}")
        finally:
            os._exit(0)
    os.close(writing)
    with open(reading, encoding="utf-8") as answers:
        news = [json.loads(line) for line in answers]
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return news, signal.Signals(os.WTERMSIG(status)).name
    return (news[:-1], news[-1][1]) if news and news[-1][0] is None else (news, "")


@contextmanager
def working_in(folder: Path) -> Iterator[None]:
    """Work in a folder while the block runs."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
