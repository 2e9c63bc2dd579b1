"""Golden sentences: what the program says to its users, in one file that is reviewed as text.

    assert golden(text)                  the text is the next sentence of this test
    assert golden_in(text)               the text holds the next sentence of this test
    with refused(Kind, "some-code"):     an error of this kind and code, whose text is the next sentence

Tests themselves ask for codes, places and numbers. `tests/sentences.json` has the sentences of each test in
the order in which it asks for them. `pytest --rewrite-sentences PATH...` replaces those of the tests that it
runs by what the program says now, and removes those of tests that are gone; then review the difference.
`same_sentences("name")` marks tests whose sentences are the same for all values of a parameter.
Paths of temporary folders, of the repository and of Python, times and numbers of processes are replaced by
names.
"""

from __future__ import annotations

import contextlib
import difflib
import json
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import Diagnostic

ROOT = Path(__file__).parents[1]
FILE = ROOT / "tests/sentences.json"
COMMAND = "pytest --rewrite-sentences"
ALIKE = 0.4
"""Least likeness of a line that replaces a sentence; chosen: a sentence that is half reworded."""


def texts_of(told: Any) -> tuple[str, ...]:
    """Return the texts of the diagnostics of a plan, a run or an error."""
    return tuple(map(str, told.diagnostics))


def places_of(told: Iterable[Diagnostic]) -> list[tuple[str, str]]:
    """Return the code and the location of each diagnostic."""
    return [(one.code, str(one.location)) for one in told]


def _key_of(item: pytest.Item) -> str:
    """Return the key of a test: without the parameters for which all sentences are the same."""
    mark, call = item.get_closest_marker("same_sentences"), getattr(item, "callspec", None)
    if mark is None or call is None:
        return item.nodeid
    others = [f"{value}" for name, value in call.params.items() if name not in mark.args]
    name = getattr(item, "originalname", item.name)
    return f"{item.nodeid.partition('::')[0]}::{name}" + (f"[{'-'.join(others)}]" if others else "")


class _Sentences:
    """The sentences of all tests, and those that the current test has asked for."""

    def __init__(self) -> None:
        self.of: dict[str, list[Any]] = {}  # test -> its sentences
        if FILE.exists():
            by_file = json.loads(FILE.read_text(encoding="utf-8"))
            self.of = {
                f"{file}::{name}": one for file, tests in by_file.items() for name, one in tests.items()
            }
        self.rewriting = False
        self.test = ""
        self.given: list[Any] = []
        self.volatile: list[tuple[re.Pattern[str], str]] = []

    def begin(self, item: pytest.Item) -> None:
        """Begin a test."""
        base = item.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
        names = [(rf"{re.escape(str(base))}/[\w.-]+", "<tmp>"), (re.escape(str(ROOT)), "<root>")]
        names += [(re.escape(path), "<python>") for path in (sys.executable, sys.prefix)]
        names += [
            (r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\+\d\d:\d\d)?", "<time>"),
            (r"\bprocess \d+", "process <id>"),
            (r"\(\d+\.\d MB\)", "(<size>)"),  # of pages: their scripts grow
            (r"(rows of \d+ variables in )\d+\.\d\d s", r"\1<time>"),
            (r"(?<![0-9A-Za-z])(?=\w*\d)[0-9a-f]{12}(?![0-9A-Za-z])", "<hash>"),
        ]
        self.volatile = [(re.compile(pattern), name) for pattern, name in names]
        self.test, self.given = _key_of(item), []

    def end(self) -> None:
        """End a test that has passed: all of its sentences must have been asked for."""
        if self.rewriting:
            if self.given or self.test in self.of:
                self.of[self.test] = self.given
        elif more := self.of.get(self.test, [])[len(self.given) :]:
            raise AssertionError(f"the test did not ask for its sentences {more}: {COMMAND}")

    def next(self) -> Any:
        """Return the next sentence of the test; None if there is none."""
        known = self.of.get(self.test, [])
        return known[len(self.given)] if len(known) > len(self.given) else None

    def plain(self, value: Any) -> Any:
        """Return a value as JSON represents it, without what differs from run to run."""
        if isinstance(value, dict):
            return {self.plain(str(key)): self.plain(one) for key, one in value.items()}
        if isinstance(value, (list, tuple)):
            return [self.plain(one) for one in value]
        if value is None or isinstance(value, (bool, int, float)):
            return value
        text = str(value)
        for pattern, name in self.volatile:
            text = pattern.sub(name, text)
        return text

    def write(self) -> None:
        """Write the file, sorted by file and test."""
        by_file: dict[str, dict[str, list[Any]]] = {}
        for test in sorted(test for test, found in self.of.items() if found):
            file, _, name = test.partition("::")
            by_file.setdefault(file, {})[name] = self.of[test]
        FILE.write_text(json.dumps(by_file, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


_sentences = _Sentences()


def golden(value: object) -> bool:
    """Compare a value, a text or texts in lists, with the next sentence of this test."""
    found, known = _sentences.plain(value), _sentences.next()
    _sentences.given.append(found)
    if not _sentences.rewriting:
        assert known is not None, f"no sentence is known: {COMMAND}\n{found}"
        assert found == known, f"not as in {FILE.name}"
    return True


def golden_in(value: object) -> bool:
    """Look for the next sentence of this test in a text, or in one of several.

    Rewriting keeps a sentence that the text still holds; else the line that is most like it replaces it.
    """
    several = not isinstance(value, (str, BaseException)) and isinstance(value, Iterable)
    text = _sentences.plain("\n".join(map(str, value)) if several else value)  # type: ignore[call-overload]
    known = _sentences.next()
    if _sentences.rewriting and (known is None or known not in text):
        known = _most_alike(known, text)
    assert known is not None, f"no sentence is known: {COMMAND}, or write it into {FILE.name}\n{text}"
    _sentences.given.append(known)
    assert known in text, f"{known!r} of {FILE.name} is not in the text"
    return True


def _most_alike(sentence: str | None, text: str) -> str | None:
    """Return the lines of a text that are most like a sentence; without one the text, if it is a line."""
    lines = text.strip().splitlines()
    if sentence is None:
        return lines[0] if len(lines) == 1 else None
    n = sentence.count("\n") + 1
    blocks = ["\n".join(lines[k : k + n]) for k in range(len(lines) - n + 1)]
    return next(iter(difflib.get_close_matches(sentence, blocks, n=1, cutoff=ALIKE)), None)


@contextlib.contextmanager
def refused(kind: type[BaseException], *codes: str) -> Iterator[pytest.ExceptionInfo[Any]]:
    """Expect an error with one of these codes, whose text is the next sentence of this test."""
    with pytest.raises(kind) as caught:
        yield caught
    if codes:
        assert caught.value.code in codes
    assert golden(caught.value)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--rewrite-sentences", action="store_true", help=f"write what the program says now to {FILE.name}"
    )


def pytest_configure(config: pytest.Config) -> None:
    _sentences.rewriting = bool(config.getoption("--rewrite-sentences"))
    if _sentences.rewriting and getattr(config.option, "numprocesses", None):
        raise pytest.UsageError("--rewrite-sentences needs a single process: leave -n out")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Find sentences of tests that are gone: rewriting removes them, a run of all files refuses them."""
    there = {_key_of(item) for item in items}
    parts = {Path(part.partition("::")[0]).as_posix() for part in map(str, config.args) if "::" in part}
    whole = {test.partition("::")[0] for test in there} - parts
    files = {test.partition("::")[0] for test in _sentences.of}
    gone_files = {file for file in files if not (ROOT / file).exists()}
    gone = [t for t in _sentences.of if t not in there and t.partition("::")[0] in whole | gone_files]
    if _sentences.rewriting:
        for test in gone:
            del _sentences.of[test]
    elif gone and files <= whole | gone_files:
        raise pytest.UsageError(
            f"{FILE.name} has sentences of tests that do not exist: {gone[:9]}; {COMMAND}"
        )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    _sentences.begin(item)
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    outcome = yield
    _sentences.end()
    return outcome


def pytest_sessionfinish() -> None:
    if _sentences.rewriting:
        _sentences.write()
