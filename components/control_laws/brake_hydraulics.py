"""Hydraulics of a stability control: one pump for all wheels, calipers, valves, accumulator, pre-charge.

    volume of a caliper    V(P) = V_0 (1 - exp(-P / P_0)) + V_1 P / P_1               P_1 = 10 MPa
    its pressure           V'(P) dP/dt = Q_in - Q_out
    a valve                Q = w Q_1 sqrt(dP / P_1)      dP from its high to its low side, w its opening
    inlet                  dP = max(P_m, P_c, P_l) - P   P_m master cylinder; of a separated wheel also the
                                                         pre-charge P_c and the line behind the pump P_l
    pump                   sum(Q_in) = Q_p s at P_l, which is at most that of the relief valve;
                           s rises within its lag; without pre-charge the pump draws a share of Q_p
    outlet                 dP = P - P_a, into the accumulator
    accumulator            P_a = P_s (1 + V_a / V_s),    dV_a/dt = sum(Q_out) - what the pump returns

V_0 is the volume of clearances, seals and the first deflection of the pads, V_1 that of caliper and pads. The
line pressure distributes the flow: a wheel with less pressure gets more. Full, the accumulator takes no more
than the pump returns. A wheel that is not separated from the driver drains through the check valve of its
inlet.

Source: structure of units with return pump, inlet and outlet valve per wheel, switch-over valve as relief
valve and low-pressure accumulator: workshop descriptions of the Mercedes-Benz C-class, 1999 and 2000, and the
Saab 9-5, 2005. Orifices and caliper stiffness are textbook hydraulics; no source at hand gives volumes and
flows, see `BrakeHydraulicsParameters`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, sqrt
from typing import Any

from ..fmi.variables import parameter

FULL = 1e7
"""P_1, the pressure [Pa] to which volumes and flows of parameters refer."""
LONGEST = 0.001
"""Longest step [s] of the integration; chosen: half of it changes pressures by less than 1 %."""
ENOUGH = 5e5
"""Pressure [Pa] before the pump with which it draws all of its flow: Mercedes-Benz C 280, 2000."""
HALVINGS = 40
"""Bisections for the line pressure: to 10 mPa."""


@dataclass(frozen=True)
class BrakeHydraulicsParameters:
    """Parameters of calipers, valves, pump, accumulator and pre-charge."""

    clearance_volume_front: float = parameter(
        3e-7,
        "m3",
        "Volume V_0 of a front caliper's clearance",
        "chosen: 0.06 mm on 2 pads of 57 mm",
        minimum=1e-9,
    )
    clearance_volume_rear: float = parameter(
        1.5e-7, "m3", "Volume V_0 of a rear caliper's clearance", "chosen: half of the front", minimum=1e-9
    )
    clearance_pressure: float = parameter(
        3e5, "Pa", "Pressure P_0 by which a clearance is filled", "chosen: 3 bar", minimum=1e3
    )
    caliper_volume_front: float = parameter(
        2.5e-6,
        "m3",
        "Volume V_1 that a front caliper takes per 10 MPa",
        "chosen: a large saloon's",
        minimum=1e-9,
    )
    caliper_volume_rear: float = parameter(
        1.2e-6,
        "m3",
        "Volume V_1 that a rear caliper takes per 10 MPa",
        "chosen: half of the front",
        minimum=1e-9,
    )
    inlet_flow: float = parameter(
        1.5e-5,
        "m3/s",
        "Flow Q_1 of an inlet valve at 10 MPa",
        "chosen: 50 MPa/s in ABS at 5 MPa",
        minimum=1e-9,
    )
    outlet_flow: float = parameter(
        1.5e-5, "m3/s", "Flow Q_1 of an outlet valve at 10 MPa", "chosen: as the inlet", minimum=1e-9
    )
    valve_lag: float = parameter(
        0.003, "s", "Time constant of a valve", "chosen: a solenoid's, open within 5 to 10 ms", minimum=0.0
    )
    pump_flow: float = parameter(
        6e-6,
        "m3/s",
        "Flow Q_p of the pump",
        "chosen: 20 MPa/s in one front brake, as `hydraulic`",
        minimum=0.0,
    )
    pump_lag: float = parameter(
        0.03, "s", "Time constant T_w of the pump's start", "chosen: a motor's", minimum=0.0
    )
    relief_pressure: float = parameter(
        1.5e7, "Pa", "Pressure of the relief valve", "Mercedes-Benz C 230, 1999: above 150 bar", minimum=1e5
    )
    accumulator_volume: float = parameter(
        5e-6,
        "m3",
        "Volume V_s at which the accumulator is full",
        "chosen: two circuits of 2.5 cm3",
        minimum=1e-9,
    )
    accumulator_pressure: float = parameter(
        2e5,
        "Pa",
        "Pressure P_s of the empty accumulator, half of that of a full one",
        "chosen: 2 bar",
        minimum=0.0,
    )
    suction_share: float = parameter(
        0.5,
        "1",
        "Share of its flow that the pump draws without pre-charge; 1 in warm fluid",
        "chosen: Kia Amanti, 2005, has the pre-charge for cold fluid, without a figure",
        minimum=0.0,
        maximum=1.0,
    )
    precharge_pressure: float = parameter(
        1e6,
        "Pa",
        "Pressure P_c of the pre-charge; 0: none",
        "Volvo S60 DSTC, 2002: around 10 bar",
        minimum=0.0,
    )
    precharge_lag: float = parameter(
        0.04, "s", "Time constant of the pre-charge", "Volvo S60 DSTC, 2002: within 100 ms", minimum=0.0
    )


def caliper_volume(pressure: float, *, clearance: float, volume: float, filled: float) -> float:
    """Return the volume [m3] of a caliper at a pressure [Pa]; V_0, V_1 [m3], P_0 [Pa]."""
    return clearance * (1.0 - exp(-pressure / filled)) + volume * pressure / FULL


def approach(x: float, target: float, h: float, lag: float) -> float:
    """Return x after `h` [s] of a first-order lag [s] towards a target."""
    return target + (x - target) * exp(-h / lag) if lag > 0.0 else target


def line_pressure(flow: float, pressures: Sequence[float], openings: Sequence[float], relief: float) -> float:
    """Return the pressure [Pa] behind the pump at which the wheels take its flow, at most `relief`.

    Args:
        flow: of the pump [m3/s].
        pressures: in the calipers [Pa].
        openings: flow of the inlets at 10 MPa [m3/s], 0 for a closed one.
        relief: of the relief valve [Pa].
    """
    low, high = 0.0, relief
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        taken = 0.0
        for pressure, opening in zip(pressures, openings, strict=True):
            if middle > pressure:
                taken += opening * sqrt((middle - pressure) / FULL)
        if taken > flow:
            high = middle
        else:
            low = middle
    return high


class BrakeHydraulics:
    """Pressures of four calipers, and the state of pump, accumulator and pre-charge.

    Args:
        p: `BrakeHydraulicsParameters`.
    """

    def __init__(self, p: Any) -> None:
        front = (p.clearance_volume_front, p.caliper_volume_front)
        rear = (p.clearance_volume_rear, p.caliper_volume_rear)
        self.volumes = (front, front, rear, rear)
        self.pressures = [0.0, 0.0, 0.0, 0.0]
        self.inlets = [1.0, 1.0, 1.0, 1.0]  # share of its opening
        self.outlets = [0.0, 0.0, 0.0, 0.0]
        self.pump = 0.0  # share of its flow
        self.stored = 0.0  # in the accumulator [m3]
        self.precharge = 0.0  # pressure from the booster [Pa]
        self.sources = [0.0, 0.0, 0.0, 0.0]  # pressures before the inlets [Pa]
        self.inflows = [0.0, 0.0, 0.0, 0.0]  # [m3/s]
        self.outflows = [0.0, 0.0, 0.0, 0.0]

    def advance(
        self,
        h: float,
        *,
        master: float,
        inlets: Sequence[float],
        outlets: Sequence[float],
        boosted: Sequence[bool],
        pumping: bool,
        filling: bool,
        p: Any,
    ) -> None:
        """Advance all by `h` [s].

        Args:
            master: pressure by the driver [Pa].
            inlets, outlets: share of its opening of each valve, 0 to 1.
            boosted: whether a wheel is separated from the driver, and supplied by pump and pre-charge.
            pumping, filling: whether pump and pre-charge are on.
            p: `BrakeHydraulicsParameters`.
        """
        steps = max(int(h / LONGEST + 0.999), 1)
        for _ in range(steps):
            self._advance(h / steps, master, inlets, outlets, boosted, pumping, filling, p)

    def _advance(
        self,
        h: float,
        master: float,
        inlets: Sequence[float],
        outlets: Sequence[float],
        boosted: Sequence[bool],
        pumping: bool,
        filling: bool,
        p: Any,
    ) -> None:
        self.pump = approach(self.pump, 1.0 if pumping else 0.0, h, p.pump_lag)
        self.precharge = approach(
            self.precharge, p.precharge_pressure if filling else 0.0, h, p.precharge_lag
        )
        aided = min(max(master, self.precharge) / ENOUGH, 1.0)
        flow = p.pump_flow * self.pump * (p.suction_share + (1.0 - p.suction_share) * aided)
        for i in range(4):
            self.inlets[i] = approach(self.inlets[i], inlets[i], h, p.valve_lag)
            self.outlets[i] = approach(self.outlets[i], outlets[i], h, p.valve_lag)
        openings = [
            p.inlet_flow * inlet if free else 0.0 for inlet, free in zip(self.inlets, boosted, strict=True)
        ]
        line = 0.0
        if flow > 0.0 and max(openings) > 0.0:
            line = line_pressure(flow, self.pressures, openings, p.relief_pressure)
        stored = p.accumulator_pressure * (1.0 + self.stored / p.accumulator_volume)
        taken = drained = 0.0
        for i, pressure in enumerate(self.pressures):
            self.sources[i] = max(master, self.precharge, line) if boosted[i] else master
            self.inflows[i] = (
                p.inlet_flow * self.inlets[i] * sqrt(max(self.sources[i] - pressure, 0.0) / FULL)
            )
            self.outflows[i] = p.outlet_flow * self.outlets[i] * sqrt(max(pressure - stored, 0.0) / FULL)
            if boosted[i] and line == self.sources[i]:
                taken += self.inflows[i]
            drained += self.outflows[i]
        returned = max(flow - taken, 0.0)
        room = (p.accumulator_volume - self.stored) / h + returned
        passed = room / drained if drained > room else 1.0
        for i, pressure in enumerate(self.pressures):
            flows = self.inflows[i] - passed * self.outflows[i]
            low = stored
            if not boosted[i] and master < pressure:  # back through the check valve of the inlet
                flows -= p.inlet_flow * sqrt((pressure - master) / FULL)
                low = min(stored, master) if self.outlets[i] > 0.0 else master
            clearance, volume = self.volumes[i]
            slope = clearance / p.clearance_pressure * exp(-pressure / p.clearance_pressure) + volume / FULL
            new = pressure + h * flows / slope
            # A valve's flow ends at equal pressures, which no step passes.
            self.pressures[i] = (
                min(new, max(self.sources[i], pressure)) if flows > 0.0 else max(new, min(low, pressure))
            )
        self.stored = min(max(self.stored + h * (passed * drained - returned), 0.0), p.accumulator_volume)
