"""Where results go if nothing else is said: a folder named after the file and what was changed.

    results/<folder of the file>/<its name>                                        as it stands
    results/<folder of the file>/<its name>,controller=controller_off,stop_time=2  changed

Whoever looks for the results of a scenario asks here, with the changes of its plan.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from ..errors import ResultsError, ScenarioError
from ..plan import Change, Value

RESULTS = Path("results")
"""Folder in the working folder that holds all results."""
LONGEST = 100
"""Characters of a name; chosen: short enough for a table, and far from what disks allow (255 bytes)."""


def default_folder(
    file: Path, changes: Iterable[Change] = (), *, suffix: str = "", name: str | None = None
) -> Path:
    """Return the folder of the results of a scenario, study or sweep file.

    Args:
        file: whose results they are.
        changes: against the file, in their order.
        suffix: of the file's name, for other results than those of a run of it.
        name: in place of one made of the file and the changes.

    Raises:
        ScenarioError: no folder can be called so.
        ResultsError: see `below_results`.
    """
    above, stem = names_of(file)
    if name is None:
        return below_results(above, _with_changes(f"{stem}{suffix}", changes))
    if not _is_name(name) or re.search(r'[\x00-\x1f/\\:*?"<>|]', name) or len(name.encode()) > 200:
        raise ScenarioError(f"--name {name}: must be the name of one folder; a path is given with --out")
    return below_results(above, name)


def names_of(file: Path) -> tuple[str, str]:
    """Return what results of a file are called: the name of its folder, "" of the root's, and its own.

    Raises:
        ScenarioError: no folder can be called as the file is.
    """
    above = Path(os.path.abspath(file)).parent.name
    if not _is_name(file.stem) or (above and not _is_name(above)):
        raise ScenarioError(f"{file}: no folder of results can be named after it; name one with --out")
    return above, file.stem


def below_results(*names: str) -> Path:
    """Return a folder below `results`, which may itself be a link; none below it is followed.

    Args:
        names: of a folder in each other; empty ones are left out.

    Raises:
        ScenarioError: no folder can be called so.
        ResultsError: one of them is a link.
    """
    place = RESULTS
    for name in filter(None, names):
        if not _is_name(name):
            raise ScenarioError(f"no folder below {RESULTS} can be called {name!r}; name one with --out")
        place /= name
        if place.is_symlink():
            raise ResultsError(
                f"{place}: is a symbolic link, which is not followed below {RESULTS}; "
                "name the folder that it leads to with --out"
            )
    return place


def _is_name(text: str) -> bool:
    """Return whether a folder can be called so: neither itself, nor the one above, nor a path."""
    return bool(text.strip(". ")) and "/" not in text and os.sep not in text


def _with_changes(stem: str, changes: Iterable[Change]) -> str:
    """Return a name with changes behind it: readable, and with a hash where that does not say all."""
    given = list(changes)
    values = [_text(one.plain) for one in given]
    of_files = [one.names_file for one in given]
    names = [re.split(r"[/\\]", v)[-1] if file else v for v, file in zip(values, of_files, strict=True)]
    readable = ",".join([stem, *(f"{one.place}={name}" for one, name in zip(given, names, strict=True))])
    portable = re.sub(r"[^\w.,=+-]", "_", readable, flags=re.ASCII)
    if not given or (names == values and portable == readable and len(portable) <= LONGEST):
        return readable
    exact = repr([(one.place, one.plain) for one in given])
    return f"{portable[: LONGEST - 7].rstrip('.')}~{hashlib.sha256(exact.encode()).hexdigest()[:6]}"


def _text(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)
