"""Where results go: folders named after the file and its overrides.

Without `--out`, results go to a folder named after the file and its overrides:

    results/<folder of the file>/<its name>                                        no overrides
    results/<folder of the file>/<its name>,controller=controller_off,stop_time=2  with overrides
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from yawbench.foundation.errors import ResultsError, ScenarioError

from ..plan import Override
from ..scenario.overrides import value_in_words

RESULTS = Path("results")
"""Folder for all results, in the working directory."""
LONGEST = 100
"""Largest length of a name. Chosen: short enough for a table, well below what disks allow (255 bytes)."""


def default_folder(
    file: Path, changes: Iterable[Override] = (), *, suffix: str = "", name: str | None = None
) -> Path:
    """Return the results folder of a scenario, study or sweep file.

    Args:
        file: the scenario or experiment file.
        changes: its overrides, in their order.
        suffix: appended to the file's name, for results other than those of a run of it.
        name: replaces the name made from the file and the overrides.

    Raises:
        ScenarioError: the name cannot be that of a folder.
        ResultsError: see `below_results`.
    """
    above, stem = names_of(file)
    if name is None:
        return below_results(above, _with_changes(f"{stem}{suffix}", changes))
    if not _is_name(name) or re.search(r'[\x00-\x1f/\\:*?"<>|]', name) or len(name.encode()) > 200:
        raise ScenarioError(
            f"--name {name}: must be the name of one folder; a path is given with --out",
            code="option-invalid",
        )
    return below_results(above, name)


def names_of(file: Path) -> tuple[str, str]:
    """Return the names that results of a file have: that of its folder ("" for the root) and its own.

    Raises:
        ScenarioError: the file's name cannot be that of a folder.
    """
    above = Path(os.path.abspath(file)).parent.name
    if not _is_name(file.stem) or (above and not _is_name(above)):
        raise ScenarioError(
            f"{file}: no folder of results can be named after it; name one with --out", code="folder-invalid"
        )
    return above, file.stem


def below_results(*names: str) -> Path:
    """Return a folder below `results`. `results` may itself be a link; links below it are refused.

    Args:
        names: of nested folders; empty ones are skipped.

    Raises:
        ScenarioError: a name cannot be that of a folder.
        ResultsError: one of the folders is a link.
    """
    folder = RESULTS
    for name in filter(None, names):
        if not _is_name(name):
            raise ScenarioError(
                f"no folder below {RESULTS} can be called {name!r}; name one with --out",
                code="folder-invalid",
            )
        folder /= name
        if folder.is_symlink():
            raise ResultsError(
                f"{folder}: is a symbolic link, which is not followed below {RESULTS}; "
                "name the folder that it leads to with --out",
                code="results-unwritable",
            )
    return folder


def _is_name(text: str) -> bool:
    """Return whether a text is a single folder name: not a path, and neither `.` nor `..`."""
    return bool(text.strip(". ")) and "/" not in text and os.sep not in text


def _with_changes(stem: str, changes: Iterable[Override]) -> str:
    """Return a name followed by its overrides, shortened and with a hash where they cannot be written out."""
    overrides = list(changes)
    values = [value_in_words(override.plain) for override in overrides]
    of_files = [override.target.names_file for override in overrides]
    names = [re.split(r"[/\\]", v)[-1] if file else v for v, file in zip(values, of_files, strict=True)]
    readable = ",".join(
        [stem, *(f"{override.target}={name}" for override, name in zip(overrides, names, strict=True))]
    )
    portable = re.sub(r"[^\w.,=+-]", "_", readable, flags=re.ASCII)
    if not overrides or (names == values and portable == readable and len(portable) <= LONGEST):
        return readable
    exact = repr([(str(override.target), override.plain) for override in overrides])
    return f"{portable[: LONGEST - 7].rstrip('.')}~{hashlib.sha256(exact.encode()).hexdigest()[:6]}"
