"""Attributes, operators and objects with two names: the same bytes as in Python, or a refusal."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from campaigns.random_programs import OBJECT
from campaigns.translated import REFUSED, SAME, Tried, tried_all

HEAD = """import copy
import enum
import functools
import sys
from dataclasses import InitVar, dataclass, field, replace
"""
METHODS = {"start": "start(self, t, u)", "advance": "advance(self, t, h, u)", "output": "output(self, t, u)"}
ENTRIES = [entry.partition("\n") for entry in
           Path(__file__).with_name("attribute_laws.txt").read_text().split("\n== ")[1:]]  # fmt: skip
BLOCKS = {name: text for name, _, text in ENTRIES if ": " not in name}


def text_of(entry: str) -> str:
    """Return the text of a law."""
    classes, *parts = re.split(r"(?m)^-- (\w+)\n", "\n" + entry)
    for name, block in BLOCKS.items():
        classes = re.sub(rf"(?m)^{name}$", lambda found, block=block: block, classes)
    lines = [HEAD, classes, "class Law:", '    inputs, outputs = ("yaw_rate", "sideslip"), ("yaw_moment",)']
    for name, body in zip(parts[::2], parts[1::2], strict=True):
        if name == "members":
            lines.append(body)
        else:
            lines += [f"    def {METHODS[name]}:", *(f"        {line}" for line in body.splitlines())]
    return "\n".join(lines) + "\n"


LAWS = {head.partition(": ")[0]: (text_of(text), head) for head, _, text in ENTRIES if ": " in head}


def check(names: list[str]) -> None:
    results = tried_all([Tried(LAWS[name][0], 7, OBJECT) for name in names])
    wanted = {name: SAME if ": same" in LAWS[name][1] else REFUSED for name in names}
    got = dict(zip(names, results, strict=True))
    different = {name: got[name] for name in names if got[name][0] != wanted[name]}
    assert not different, different


def test_attributes_and_operators_are_those_of_python_or_refused() -> None:
    check([name for name, (_, head) in LAWS.items() if head.endswith("*")])


@pytest.mark.exhaustive
def test_all_forms_of_attributes_and_operators_are_those_of_python_or_refused() -> None:
    check(list(LAWS))
