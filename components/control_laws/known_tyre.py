"""Tyre models that wheel controls know, and the slip at which such a tyre's braking force is largest.

With the slip angle alpha the optimum kappa_opt(alpha) of the braking force grows: of tyre set 1 at 4.5 kN and
mu 0.9 it is 0.13 at 0, 0.29 at 8 and 0.43 at 12 degrees. At 8 degrees a slip of 0.05 gives 44 % of the largest
force.
"""

from dataclasses import dataclass
from typing import Any

from ..fmi.variables import parameter
from ..tyre_models.slip_curve import slip_for_force
from ..tyre_models.tyre import Curve, Tyre
from ..tyres.dugoff import Dugoff
from ..tyres.linear import LinearTyre
from ..tyres.magic_formula import MagicFormula
from ..tyres.magic_formula_62 import MagicFormula62
from ..tyres.magic_formula_1987 import MagicFormula1987

TYRES: dict[str, type[Tyre]] = {
    "magic_formula": MagicFormula,
    "magic_formula_1987": MagicFormula1987,
    "magic_formula_62": MagicFormula62,
    "dugoff": Dugoff,
    "linear": LinearTyre,
}
"""Tyre models available to wheel controls."""

ANY_FORCE = 1e6
"""More than any tyre gives [N], so that what is asked for is the limit of the slip."""

OF_TYRES: Any = tuple(tyre.CurveParameters for tyre in TYRES.values())


@dataclass(frozen=True)
class KnownTyreParameters(*OF_TYRES):  # type: ignore[misc]  # as many bases as tyres
    """Parameters of all tyre models; only those of the selected model are used."""

    tyre: str = parameter(
        "magic_formula",
        None,
        "Tyre model",
        "chosen: the tyre of paper B",
        choices=tuple(TYRES),
    )


def optimum_slip(curve: Curve, *, driving: bool, cap: float) -> float:
    """Return |kappa| [1] of the largest driving or braking force, at most `cap`.

    Args:
        curve: slip curve of the tyre at the current slip angle, load and friction.
        driving: the side of the curve.
        cap: largest slip [1]; also the result for a tyre without load or whose force has no optimum below.
    """
    force, first = curve
    most = ANY_FORCE if driving else -ANY_FORCE
    return abs(slip_for_force(most, force, first=first, cap=cap, share=1.0))
