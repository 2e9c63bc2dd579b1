"""Numbers in files of experiments: plain ones in SI, or with their unit as text."""

from __future__ import annotations

import re
import sys
from typing import Annotated

from pydantic import PlainValidator

from ..scenario.quantities import convert
from ..wording import short


def text_of(value: object) -> str:
    """Return a plain value as a YAML file would have it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def is_finite(value: object) -> bool:
    """Return whether a value is a finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) <= sys.float_info.max  # also of whole numbers that no float can hold


def si_number(given: float | str, unit: str) -> float:
    """Return a number in SI, given as such or as text with its unit; `%` stands for a ratio.

    Raises:
        ValueError: a sentence that says what the text should have been.
    """
    return float(convert(given, "1" if unit == "%" else unit) if isinstance(given, str) else given)


def _number(value: object) -> float | int:
    if not is_finite(value):
        raise ValueError(f"must be a number (got {short(value)})")
    return value  # type: ignore[return-value]


def is_quantity(value: object) -> bool:
    """Return whether a value is a number, or text that begins with one."""
    return is_finite(value) or (isinstance(value, str) and re.match(r"\s*[+-]?\.?\d", value) is not None)


def _quantity(value: object) -> float | str:
    if not is_quantity(value):
        raise ValueError(f"must be a number, or a number with its unit ('5 %') (got {short(value)})")
    return value  # type: ignore[return-value]


Number = Annotated[float | int, PlainValidator(_number)]
Quantity = Annotated[float | int | str, PlainValidator(_quantity)]
"""A number in SI, or text that begins with one and ends with its unit."""
