"""Every command and program in the README and the docs, run as it stands in a copy of the checkout."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.checkout import ROOT, copy_checkout, run_in
from yawbench.fmus.build import HERE, build_all

PAGES = [
    "docs/tutorial.md",
    *sorted(
        str(file.relative_to(ROOT)) for file in (ROOT / "docs").rglob("*.md") if file.name != "tutorial.md"
    ),
    "README.md",
]
"""In the order in which they are read here: later pages may use what earlier ones have written."""

NOT_RUN = {
    r"make \w+": "sets up an environment from the network; what it then calls is run here or is the test run",
    r"\S*python -m pip install .*": "takes packages from the network",
    r"\S*yawbench study scenarios/(fnn_sideslip|fuzzy_\w+)/\w+\.yaml": "tests/scenarios/test_papers.py",
    r"\S*yawbench study scenarios/real_signals/\w+\.yaml": "tests/scenarios/test_real_signals.py",
    r"\S*yawbench serve.*": "until Ctrl-C; tests/bench/test_serve.py",
    r"\S*yawbench drive .*": "minutes; test_sine_with_dwell.py drives short ones",
    r"\S*yawbench rank.*": "half an hour; tests/ranking/test_ranking_page.py drives a small one",
    r"\S*yawbench compare scenarios/one_car/\S+ --swap plant=\S+": "test_vehicles.py: shorter runs",
    r"\S*yawbench vehicle show \S+ --plant \S+": "four plants; test_vehicles.py drives each",
}
"""Commands that this test does not run -> why, or the test that runs the same at length."""

PROGRAM = "<program>"
"""Path of blocks of Python that are no file: those of a page are one program, run at its end."""

_FENCE = re.compile(r'```(\w+)(?: title="([^"]+)")?\n(.*?)```', re.DOTALL)
_INDENTED = re.compile(r"^    ((?:\.venv/bin/|make ).*)$", re.MULTILINE)
_NAMED_BEFORE = re.compile(r"Put this into `([^`]+)`:\s*$")


class Block(NamedTuple):
    """A file to be written (with a path), a program in Python (`PROGRAM`), or commands to be run."""

    place: int
    path: str
    text: str


def blocks(page: str) -> list[Block]:
    """Return what a reader of a page writes and types, in order."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = []
    for match in _FENCE.finditer(text):
        language, title, content = match.groups()
        named = _NAMED_BEFORE.search(text[: match.start()])
        if title or named:
            found.append(Block(match.start(), title or (named[1] if named else ""), content))
        elif language == "python":
            found.append(Block(match.start(), PROGRAM, content))
        elif language in ("sh", "console", "bash", "shell"):
            found.append(Block(match.start(), "", content))
    outside = _FENCE.sub(lambda match: " " * len(match[0]), text)
    found += [Block(match.start(), "", match[1]) for match in _INDENTED.finditer(outside)]
    return sorted(found)


def commands(block: Block) -> list[str]:
    """Return the commands of a block, without comments and prompts, continued lines joined."""
    if block.path:
        return []
    lines = block.text.replace("\\\n", " ").splitlines()
    bare = [re.sub(r"\s+#.*$", "", line.strip().removeprefix("$ ")) for line in lines]
    return [line for line in bare if line and not line.startswith("#")]


def not_run(command: str) -> bool:
    return any(re.fullmatch(pattern, command) for pattern in NOT_RUN)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the checkout, all FMUs built, no results."""
    build_all(HERE)
    return copy_checkout(tmp_path_factory.mktemp("copy") / "yawbench")


@pytest.fixture(scope="module")
def done():
    """The commands that have been run; none but `yawbench build` is run twice."""
    return set()


@pytest.mark.exhaustive
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_a_page_works_as_it_stands(page, checkout, done):
    program = "".join(block.text for block in blocks(page) if block.path == PROGRAM)
    for block in blocks(page):
        if block.path and block.path != PROGRAM:
            file = checkout / block.path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(block.text, encoding="utf-8")
        for command in commands(block):
            repeated = command in done and not command.endswith("yawbench build")
            if not_run(command) or repeated:
                continue
            done.add(command)
            ended = run_in(checkout, *shlex.split(command))
            assert ended.returncode == 0, f"{command}\n{ended.stdout[-2000:]}\n{ended.stderr[-2000:]}"
            assert "Traceback" not in ended.stderr, command
    if program:
        (checkout / "page.py").write_text(program, encoding="utf-8")  # a function needs a source
        ended = run_in(checkout, "python", "page.py", MPLBACKEND="agg")
        assert ended.returncode == 0, f"{program}\n{ended.stderr[-2000:]}"


def test_what_is_not_run_is_in_the_docs():
    everything = [command for page in PAGES for block in blocks(page) for command in commands(block)]
    for pattern in NOT_RUN:
        assert any(re.fullmatch(pattern, command) for command in everything), f"{pattern} is no longer needed"


def test_a_python_file_that_a_page_shows_is_the_one_that_its_commands_use():
    shown = {block.path for page in PAGES for block in blocks(page) if block.path} - {PROGRAM}
    assert {"components/controllers/yaw_follow.py", "components/controllers/yaw_rate.py"} <= shown
    assert all(not (ROOT / Path(path)).exists() for path in shown)
