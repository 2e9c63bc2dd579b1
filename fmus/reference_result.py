"""Reference results: outputs of an FMU for given inputs, for comparison with other tools.

Inputs, settings and outputs are in the format of the FMI Cross-Check (`NAME_in.csv`, `NAME_ref.opt`,
`NAME_ref.csv`), which many tools read; a manifest following FMI-LS-REF 1.0.0-alpha.1, the layered
standard for reference files, describes them.

Every input is a sine within its usual range, with its own frequency; parameters have their default
values. Outputs are rounded to six digits of the largest value of their column, so that differences
between mathematical libraries vanish and the same sources give the same bytes.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

from .usual_ranges import usual_range

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
STOP, STEP = 2.0, 0.02  # [s], chosen: all components respond by then; few enough rows for an archive
DIGITS = 6
"""Digits of the largest value of a column. Chosen: much coarser than differences of math libraries."""
_MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
  fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1"
  fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">
  <Related type="text/csv" source="{name}_in.csv" role="testcase"
    description="Inputs, set before every step" />
  <Related type="text/csv" source="{name}_ref.opt" role="configuration"
    description="Settings of the run, in s" />
  <Related type="text/csv" source="{name}_ref.csv" role="result" description="Outputs after every step" />
  <Related type="text/html" source="../../documentation/index.html" role="document"
    description="Equations, variables, source" />
</fmiReferences>
"""
_LOWEST, _SPACING = 0.5, 0.07  # [Hz], chosen: between one and five periods within the run


def reference_result(fmu: Path) -> dict[str, str]:
    """Run an FMU and return its reference result, as path in the archive -> text.

    Raises:
        Exception: the run failed.
    """
    import fmpy

    description = fmpy.read_model_description(str(fmu))
    name = description.modelName
    reals = [v for v in description.modelVariables if v.type == "Real"]
    inputs = _stimuli([v.name for v in reals if v.causality == "input"])
    result = fmpy.simulate_fmu(
        str(fmu),
        stop_time=STOP,
        output_interval=STEP,
        input=inputs if inputs.dtype.names[1:] else None,
        output=[v.name for v in reals if v.causality == "output"],
        fmi_call_logger=None,
    )
    settings = {"StartTime": 0.0, "StopTime": STOP, "StepSize": STEP, "RelTol": 10.0 ** (1 - DIGITS)}
    contents = {
        f"{name}_in.csv": _csv(inputs),
        f"{name}_ref.opt": "".join(f"{key},{value:g}\n" for key, value in settings.items()),
        f"{name}_ref.csv": _csv(result),
        "fmi-ls-manifest.xml": _MANIFEST.format(name=name),
    }
    return {f"{FOLDER}/{file}": text for file, text in contents.items()}


def _stimuli(names: list[str]) -> Any:
    """Return a structured array of time and inputs, a row for each communication point."""
    import numpy as np

    table = np.zeros(round(STOP / STEP) + 1, dtype=[("time", float), *((name, float) for name in names)])
    table["time"] = [round(k * STEP, 9) for k in range(len(table))]
    for i, name in enumerate(names):
        low, high = usual_range(name)
        swing = np.sin(2.0 * math.pi * (_LOWEST + _SPACING * (i % 32)) * table["time"])
        table[name] = _rounded((low + high) / 2.0 + (high - low) / 2.0 * swing)
    return table


def _rounded(values: Any) -> Any:
    """Return values rounded to the decimals at which the largest has `DIGITS` digits."""
    largest = float(abs(values).max())
    decimals = DIGITS - 1 - math.floor(math.log10(largest)) if largest else 0
    return values.round(decimals) + 0.0  # no negative zero


def _csv(table: Any) -> str:
    import numpy as np

    names = table.dtype.names
    columns = [table["time"], *(_rounded(table[name]) for name in names[1:])]
    text = io.StringIO()
    header = ",".join(f'"{name}"' for name in names)
    np.savetxt(text, np.column_stack(columns), "%.10g", ",", header=header, comments="")
    return text.getvalue()
