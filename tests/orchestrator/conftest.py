"""Fixtures of foreign FMUs and their runs, beside `foreign_fmus`."""

from __future__ import annotations

import pytest

from tests.orchestrator.foreign_fmus import KINDS, SCENARIO, write_fmu


@pytest.fixture
def isolate() -> list[str]:
    """Options of a run that say whether its instances have processes of their own, set by the marks."""
    return []


@pytest.fixture
def scenario(library, tmp_path):
    """Write a scenario of two units of an FMU, the second fed by the first; return its path."""

    def write(
        *, answer=0, given=KINDS, guid="{good}", scale="", record="", binary=library, change=lambda xml: xml,
        more="",
    ):  # fmt: skip
        write_fmu(tmp_path / "foreign.fmu", binary, *given, guid=guid, change=change)
        scale = f", {scale}" if scale else ""
        wires = [f"  - {{from: a.{kind}_out, to: b.{kind}_in{scale}}}" for kind in given]
        constants = ", ".join(f"a.{kind}_in: {value}" for kind, value in given.items())
        parts = {"constants": f"{{{constants}}}", "connections": "\n".join(wires)}
        text = SCENARIO.format(**parts, answer=answer, more=more, record=record)
        (tmp_path / "two.yaml").write_text(text, encoding="utf-8")
        return tmp_path / "two.yaml"

    return write
