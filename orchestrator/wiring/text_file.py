"""The text of a file in place of a parameter's value."""

from __future__ import annotations

from pathlib import Path

from ..files import TEXT, read_bytes
from ..plan import Variable
from ..scenario.scenario_schema import TextSpec


def text_of(spec: TextSpec, folder: Path, variable: Variable) -> str:
    """Return the text of a file that is named relative to a folder.

    Raises:
        ValueError: a sentence: the parameter is no text, there is no such file, or it is not UTF-8.
    """
    if variable.type != "String":
        raise ValueError("takes a value: only parameters that are text take a file")
    try:
        return read_bytes(folder / spec.file, largest=TEXT).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{spec.file}: the file is not UTF-8") from None
    except OSError as error:
        raise ValueError(f"{spec.file}: {(error.strerror or 'cannot be read').lower()}") from None
    except ValueError as error:
        raise ValueError(f"{spec.file}: {error}") from None
