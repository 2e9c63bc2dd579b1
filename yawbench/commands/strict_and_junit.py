"""`--strict` and `--junit`: verdicts as an exit status, and as a report for continuous integration.

A command that judges is marked `@judging` and passes its verdicts to `judged`, whatever the options say. A
verdict that failed is a failure; one that is undecided, depends on open values or could not be reached is
skipped, with its reason; a run that was not completed is an error.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from xml.etree import ElementTree

import typer

from yawbench.foundation.messages import printable

from .json_and_latex import with_options

if TYPE_CHECKING:
    from yawbench.metrics.verdict import Judged, Status, Verdict
    from yawbench.studies.experiment_result import ExperimentResult

Strict = Annotated[
    bool, typer.Option("--strict", help="Exit with 1 if a verdict is that a test, claim or limit failed.")
]
Junit = Annotated[
    Path | None, typer.Option("--junit", metavar="FILE", help="Write the verdicts as a JUnit report (XML).")
]


@dataclass(frozen=True)
class JudgedCase:
    """A verdict under the title of what was judged; without a status, a run that was not completed."""

    suite: str
    name: str
    status: Status | None
    words: str
    why: str = ""


_CASES: ContextVar[list[JudgedCase]] = ContextVar("_CASES")


def judged(suite: str, verdicts: Iterable[tuple[str, Verdict]], of: Judged = "criteria") -> None:
    """Add verdicts, each with the name of its criterion, claim or limit."""
    from yawbench.metrics.verdict import worded

    _add(JudgedCase(suite, name, one.status, worded(one.status, of), _reason(one)) for name, one in verdicts)


def broken_off(suite: str, runs: Iterable[tuple[str, str]]) -> None:
    """Add runs that were not completed, each with the reason."""
    _add(JudgedCase(suite, name, None, "not completed", why) for name, why in runs)


def judged_experiment(findings: ExperimentResult) -> None:
    """Add the claims, checks and limits of an experiment, and its runs that failed."""
    from yawbench.metrics.verdict import Status, Verdict
    from yawbench.studies.limits import limits_of
    from yawbench.studies.result_tables import measured_words

    title = findings.spec.title
    for result in findings.judgements:
        why = "; ".join(measured_words(result))
        verdict = replace(result.verdict, status=result.status, why=why)
        judged(title, [(result.claim.says, verdict)], result.group)
    for spec in findings.spec.limits.values():
        for limit in limits_of(findings, spec):
            where = ", ".join(f"{axis} {level.words}" for axis, level in limit.others.items())
            name = f"{spec.says} ({where})" if where else spec.says
            if limit.verdict.status is Status.NOT_JUDGED:
                verdict = limit.verdict
            elif limit.largest is None:
                verdict = Verdict(Status.FAILED, why="not even at the least value")
            else:
                verdict = Verdict(Status.PASSED, why=f"up to {limit.largest:g}")
            judged(title, [(name, verdict)])
    broken_off(title, findings.failed.items())


def _add(cases: Iterable[JudgedCase]) -> None:
    if (collected := _CASES.get(None)) is not None:
        collected.extend(cases)


def _reason(verdict: Verdict) -> str:
    """Return why a verdict is as it is: its words, else its number against its bound."""
    from yawbench.metrics.verdict import SYMBOLS

    if verdict.why or verdict.value is None or verdict.bound is None or verdict.relation is None:
        return verdict.why
    unit = "" if verdict.unit in ("", "1") else f" {verdict.unit}"
    return f"{verdict.value:.6g}{unit}, to be {SYMBOLS[verdict.relation]} {verdict.bound:.6g}{unit}"


def judging(command: Callable[..., None]) -> Callable[..., None]:
    """Mark a command that judges, and so takes `--strict` and `--junit`."""

    @functools.wraps(command)
    def called(*, strict: bool, junit: Path | None, **arguments: Any) -> None:
        cases: list[JudgedCase] = []
        token = _CASES.set(cases)
        ended: typer.Exit | None = None
        try:
            command(**arguments)
        except typer.Exit as exit_:
            ended = exit_
        finally:
            _CASES.reset(token)
        if junit is not None:
            from yawbench.foundation.safe_files import write_whole

            write_whole(junit, to_junit(cases))
        if ended is not None:
            raise ended
        if strict and any(_failed(case) for case in cases):
            raise typer.Exit(1)

    return with_options(command, called, strict=(False, Strict), junit=(None, Junit))


def _failed(case: JudgedCase) -> bool:
    from yawbench.metrics.verdict import Status

    return case.status in (Status.FAILED, None)


def to_junit(cases: Iterable[JudgedCase]) -> str:
    """Return verdicts as a JUnit report: a suite for each title, a test case for each verdict.

    The elements are those that Jenkins, GitLab and GitHub read (testsuites, testsuite, testcase, failure,
    error, skipped).
    """
    from yawbench.metrics.verdict import Status

    tags = {Status.PASSED: "", Status.FAILED: "failure", None: "error"}
    counted = {"tests": "testcase", "failures": "failure", "errors": "error", "skipped": "skipped"}
    root = ElementTree.Element("testsuites", name="yawbench")
    suites: dict[str, ElementTree.Element] = {}
    for case in cases:
        title = printable(case.suite)
        if title not in suites:
            suites[title] = ElementTree.SubElement(root, "testsuite", name=title)
        entry = ElementTree.SubElement(suites[title], "testcase", classname=title, name=printable(case.name))
        if tag := tags.get(case.status, "skipped"):
            told = printable(f"{case.words}: {case.why}" if case.why else case.words)
            ElementTree.SubElement(entry, tag, message=told)
    for element in (*suites.values(), *([root] if suites else ())):
        for name, tag in counted.items():
            element.set(name, str(sum(1 for _ in element.iter(tag))))
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
