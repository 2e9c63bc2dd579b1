"""Experiment files with some of their text replaced."""

from __future__ import annotations

from pathlib import Path


def written(folder: Path, text: str, *changes: tuple[str, str], **beside: str) -> Path:
    """Write a file with texts of it replaced, and others beside it by their names; return its path."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    for name, content in {**beside, "experiment": text}.items():
        (folder / f"{name}.yaml").write_text(content)
    return folder / "experiment.yaml"
