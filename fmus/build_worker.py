"""Processes that build FMUs by name, for builds on all processor cores.

They are asked and answer through pipes alone (see `build.main`): the queues of `concurrent.futures` need
semaphores, which outlive a command that is killed.
"""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from orchestrator.processes import how_it_ended, python


def build_apart(names: Sequence[str], out: Path, root: Path, workers: int) -> Iterator[tuple[str, list[str]]]:
    """Build components in processes of their own; yield each name with its problems, as they are finished."""
    waiting: queue.SimpleQueue[str] = queue.SimpleQueue()
    finished: queue.SimpleQueue[tuple[str, list[str]]] = queue.SimpleQueue()
    for name in names:
        waiting.put(name)
    processes: list[subprocess.Popen[str]] = []

    def serve() -> None:
        process = _started(out, root)
        processes.append(process)
        assert process.stdin is not None and process.stdout is not None
        with process:
            while True:
                try:
                    name = waiting.get_nowait()
                except queue.Empty:
                    process.stdin.close()
                    return
                try:
                    process.stdin.write(f"{name}\n")
                    process.stdin.flush()
                    answer = process.stdout.readline()
                except OSError:
                    answer = ""
                problems = json.loads(answer) if answer else None
                if problems is None:
                    problems = [f"{name}: the process that built it {how_it_ended(process.wait())}"]
                finished.put((name, problems))
                if not answer:
                    return serve()

    for _ in range(workers):
        threading.Thread(target=serve, daemon=True).start()
    left = len(names)
    try:
        while left:
            yield finished.get()
            left -= 1
    finally:
        if left:  # interrupted
            while not waiting.empty():
                waiting.get()
            for process in processes:
                process.terminate()


def _started(out: Path, root: Path) -> subprocess.Popen[str]:
    command = python("fmus.build", out, root)
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )
