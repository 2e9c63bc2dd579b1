"""Brakes of a production-like stability control: slip limits, ABS cycles, hydraulics, engine cut, heat.

    P_m  = -min(F_d, 0) R / (2 (C_f + C_r))        pressure by the driver, whose brake force is F_d
    P*_i = min(max(-F_i, 0) R / C_i, P_max)        pressure that the request asks of a wheel
    T_i  = R (1 - cut) max(F_i, 0) - C_i P_i       cut: `engine_reduction`

    slip limit     kappa_max = q min(kappa_opt(alpha, F_z, mu), cap)        `control_laws.known_tyre`
    release        braking slip above kappa_max                         outlet open, inlet closed
    hold           braking slip above q_hold kappa_max                  both closed
    apply          else, while P_i < P*_i                               inlet open; after a release, in pulses
    reduce         P_i > P*_i by a tolerance                            outlet open

F_i is the request of the allocator, with the driver's part. A wheel whose P*_i exceeds P_m is separated from
the driver and supplied by the pump, the others by the master cylinder (`control_laws.brake_hydraulics`). Pump
and pre-charge are on while a wheel asks for more than the driver gives or `brake_preparation` is 1; the pump
also empties the accumulator.

A wheel may slip up to the optimum of its tyre at the present slip angle, load and friction, which production
units have in tables: 0.13 straight ahead, 0.29 at 8 degrees (tyre set 1). At walking pace slip is meaningless
and not limited.

Heat: what a brake takes up, E, cools with a time constant, dE/dt = C P |w| - E / T_E. Beyond its limit, or
after the pump has run for longer than it may, no wheel is braked beyond the driver's pressure until all have
fallen to `recovery_share` of their limits.

Source: wheels held at slip targets by the stability control: A. T. van Zanten, R. Erhardt, G. Pfaff, SAE
950759, 1995; the three phases of ABS: workshop description of the Saab 9-5, 2005; brakes that have been
applied for too long are no longer: that of the Saab 9-3, 2004, without the time. Chosen: the tyre's optimum
in place of tables, one pump for both circuits, heat as energy of a disc of 8 kg.
"""

from dataclasses import dataclass
from math import exp

from ..control_laws.brake_hydraulics import BrakeHydraulics, BrakeHydraulicsParameters
from ..control_laws.known_tyre import TYRES, KnownTyreParameters, optimum_slip
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from .hydraulic import HydraulicParameters
from .slip import SlipParameters

APPLY, HOLD, RELEASE = 0.0, 1.0, 2.0
"""Values of `valve_state_*`."""


@dataclass(frozen=True)
class EscBrakeParameters(BrakeHydraulicsParameters, KnownTyreParameters):
    """Parameters of brakes, slip limits, cycles and heat, and of the tyres that it knows."""

    wheel_radius: float = like(HydraulicParameters, "wheel_radius")
    brake_factor_front: float = like(HydraulicParameters, "brake_factor_front")
    brake_factor_rear: float = like(HydraulicParameters, "brake_factor_rear")
    drive_torque_limit: float = like(HydraulicParameters, "drive_torque_limit")
    pressure_limit: float = like(HydraulicParameters, "pressure_limit", 1.5e7, "chosen: the relief valve's")
    optimum_share: float = like(SlipParameters, "optimum_share")
    slip_cap: float = like(SlipParameters, "slip_cap", 0.35, "chosen: a front tyre's optimum at 9 degrees")
    hold_share: float = parameter(
        0.8, "1", "Share of the slip limit above which pressure is held", "chosen", minimum=0.0, maximum=1.0
    )
    pulse_share: float = parameter(
        0.3,
        "1",
        "Share of its opening that an inlet has after a release",
        "chosen: pulses",
        minimum=0.01,
        maximum=1.0,
    )
    pressure_tolerance: float = parameter(
        2e5, "Pa", "Pressure above the requested one that is left in a brake", "chosen: 2 bar", minimum=0.0
    )
    release_speed: float = like(HydraulicParameters, "release_speed")
    brake_energy_limit: float = parameter(
        1.8e6,
        "J",
        "Energy in a brake above which the control brakes no more",
        "chosen: 8 kg of iron, 450 K",
        minimum=1.0,
    )
    cooling_time: float = parameter(
        120.0, "s", "Time constant of the brakes' and the pump's cooling", "chosen", minimum=0.1
    )
    pump_time_limit: float = parameter(
        60.0,
        "s",
        "Time for which the pump may run",
        "chosen: Saab 9-3 has such a limit, unknown",
        minimum=0.0,
    )
    recovery_share: float = parameter(
        0.8, "1", "Share of these limits at which it brakes again", "chosen", minimum=0.0, maximum=1.0
    )


class EscBrakes(Component):
    """Brakes of a production-like stability control: slip targets, ABS cycles, one pump for all wheels."""

    Parameters = EscBrakeParameters
    sampled = True
    inputs = (
        "force_request_*",
        "slip_ratio_*",
        "slip_angle_*",
        "vertical_load_*",
        "wheel_speed_*",
        "wheel_velocity_*",
        "friction_*",
        signal("drive_force", optional=True),
        signal("engine_reduction", optional=True),
        signal("brake_preparation", optional=True),
    )
    outputs = (
        output("torque_request_*", "force_request_*", "engine_reduction"),
        output("brake_pressure_*", unit="Pa", text="Pressure in the wheel's brake cylinder"),
        output("slip_limit_*", unit="1", text="Braking slip above which pressure is released; 0: not braked"),
        output("valve_state_*", unit="1", text="State of the wheel's valves: 0 apply, 1 hold, 2 release"),
        output("master_pressure", unit="Pa", text="Pressure in the master cylinder, by the driver"),
        output("pump_share", unit="1", text="Share of its flow that the pump gives"),
        output("accumulator_fill", unit="1", text="Share of the accumulator that is full"),
        output("brake_energy", unit="J", text="Energy in the hottest brake"),
    )

    def configure(self) -> None:
        p = self.p
        front, rear = p.brake_factor_front, p.brake_factor_rear
        self.factors = (front, front, rear, rear)
        self.per_force = p.wheel_radius / (2.0 * (front + rear))
        self.axles = TYRES[p.tyre].for_curve(p)

    def start(self, t: float, u: list[float]) -> None:
        self.hydraulics = BrakeHydraulics(self.p)
        self.states = [APPLY, APPLY, APPLY, APPLY]
        self.pulsed = [False, False, False, False]
        self.limits = [0.0, 0.0, 0.0, 0.0]
        self.inlets = [1.0, 1.0, 1.0, 1.0]
        self.outlets = [0.0, 0.0, 0.0, 0.0]
        self.boosted = [False, False, False, False]
        self.energies = [0.0, 0.0, 0.0, 0.0]
        self.running = 0.0  # time [s] for which the pump has run, less what it has cooled
        self.hot = False
        self.master = self._master(u[28])

    def advance(self, t: float, h: float, u: list[float]) -> None:
        if h <= 0.0:
            return
        p = self.p
        self.master = self._master(u[28])
        self._heat(h, u)
        asking = False
        for i in range(4):
            wanted = min(max(-u[i], 0.0) * p.wheel_radius / self.factors[i], p.pressure_limit)
            if self.hot:
                wanted = min(wanted, self.master)
            more = wanted > self.master + p.pressure_tolerance
            asking = asking or more
            self._choose(i, wanted, more, u)
        filling = not self.hot and (asking or u[30] > 0.5)
        releasing = max(self.outlets) > 0.0 or self.hydraulics.stored > 0.0
        self.hydraulics.advance(
            h,
            master=self.master,
            inlets=self.inlets,
            outlets=self.outlets,
            boosted=self.boosted,
            pumping=filling or releasing,
            filling=filling,
            p=p,
        )

    def output(self, t: float, u: list[float]) -> list[float]:
        p = self.p
        pressures = self.hydraulics.pressures
        left = 1.0 - min(max(u[29], 0.0), 1.0)
        torques = [
            left * min(max(force, 0.0) * p.wheel_radius, p.drive_torque_limit) - factor * pressure
            for force, factor, pressure in zip(u[:4], self.factors, pressures, strict=True)
        ]
        rest = [
            self.master,
            self.hydraulics.pump,
            self.hydraulics.stored / p.accumulator_volume,
            max(self.energies),
        ]
        return torques + pressures + self.limits + self.states + rest

    def _master(self, drive: float) -> float:
        """Return the pressure [Pa] by the driver for his force [N], negative when braking."""
        limit: float = self.p.pressure_limit
        pressure: float = max(-drive, 0.0) * self.per_force
        return min(pressure, limit)

    def _choose(self, i: int, wanted: float, more: bool, u: list[float]) -> None:
        """Set the valves of a wheel for the pressure [Pa] that is wanted, `more` than the driver's or not."""
        p = self.p
        pressure = self.hydraulics.pressures[i]
        kappa, v = u[4 + i], u[20 + i]
        slip = -kappa if v >= 0.0 else kappa
        self.limits[i] = 0.0
        state = APPLY
        if pressure > p.pressure_tolerance and abs(v) > p.release_speed:
            curve = TYRES[p.tyre].curve(u[8 + i], u[12 + i], u[24 + i], self.axles[i])
            limit = p.optimum_share * optimum_slip(curve, driving=v < 0.0, cap=p.slip_cap)
            self.limits[i] = limit
            if slip > limit:
                state = RELEASE
            elif slip > p.hold_share * limit:
                state = HOLD
        if state == RELEASE:
            self.pulsed[i] = True
        elif wanted <= p.pressure_tolerance:
            self.pulsed[i] = False
        separated = more or (self.boosted[i] and wanted > p.pressure_tolerance and wanted > self.master)
        if state == APPLY and wanted < pressure:
            reduce = wanted < pressure - p.pressure_tolerance and (separated or wanted < self.master)
            state = RELEASE if reduce else HOLD if separated or wanted < self.master else APPLY
        self.states[i] = state
        self.boosted[i] = separated
        self.inlets[i] = 0.0 if state != APPLY else p.pulse_share if self.pulsed[i] else 1.0
        self.outlets[i] = 1.0 if state == RELEASE else 0.0

    def _heat(self, h: float, u: list[float]) -> None:
        """Advance the energies of the brakes and the running time of the pump, and see whether they may."""
        p = self.p
        kept = exp(-h / p.cooling_time)
        for i in range(4):
            power = self.factors[i] * self.hydraulics.pressures[i] * abs(u[16 + i])
            self.energies[i] = self.energies[i] * kept + h * power
        self.running = self.running * kept + h * self.hydraulics.pump
        share = p.recovery_share if self.hot else 1.0
        self.hot = (
            max(self.energies) > share * p.brake_energy_limit or self.running > share * p.pump_time_limit
        )
