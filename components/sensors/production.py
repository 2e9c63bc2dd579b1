"""Sensor cluster of a production car: gyro, accelerometers, wheel speeds, hand wheel, brake pressures.

    gyro             r
    accelerometers   f_x = a_x cos(theta) - g sin(theta)                theta = pitch - slope         (1)
                     f_y = a_y cos(phi) + g sin(phi)                    phi = roll + bank
    wheel speeds     w_i;      hand wheel: delta;      brake pressures: p_i

Each signal passes a channel (`sensing.channel`) with low pass, gain, bias, drift, noise, range, quantum and
latency, and is held from message to message. Accelerometers are fixed to the body at the centre of mass and
measure gravity and acceleration according to (1), with roll positive for the left side up, pitch positive for
the nose down, and the angles by which the road rises forwards and to the left. Inputs that are not connected
(plant without roll, flat road) are zero.

Inputs are the true values, named `*_true`: `{from: [plant, driver], to: sensor.*_true}`. Outputs have the
plain names, so that `{from: [sensor], to: [controller]}` replaces the true values by measurements.

The hand-wheel sensor gives road-wheel angles: its properties are those at the hand wheel divided by a
steering ratio of 16. Biases are zero here, as after successful zero-point learning of a control unit;
remaining biases in cars are up to 0.3 deg/s and 0.2 m/s2.

Sources are given with the parameters. `sensors.ideal` and `sensors.poor` are the same with other values.
"""

from math import cos, sin

from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.signals import SIGNALS
from yawbench.vocabulary.wheels import wheels

from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal
from ..sensing.channel import Channel, ChannelSpec
from ..sensing.cluster_parameters import Figures, figures_of, parameters_of
from ..sensing.noise import key

_SMI700 = "Bosch, SMI700 product sheet"
_CORNER = (21.0, f"{_SMI700}: 21 Hz")
_ACCELEROMETER = {
    "bandwidth": _CORNER,
    "noise": (0.0588, f"{_SMI700}: 6 mg"),
    "range": (49.05, f"{_SMI700}: 5 g"),
    "quantum": (0.00196, f"{_SMI700}: 5000 per g"),
}

PRODUCTION: Figures = {
    "yaw_rate": {
        "bandwidth": _CORNER,
        "noise": (0.001745, f"{_SMI700}: 0.1 deg/s"),
        "range": (5.236, f"{_SMI700}: 300 deg/s"),
        "quantum": (0.0001745, f"{_SMI700}: 100 per deg/s"),
    },
    "acceleration_x": _ACCELEROMETER,
    "acceleration_y": _ACCELEROMETER,
    "steer_angle": {
        "range": (0.85, "chosen: 780 deg at the hand wheel"),
        "quantum": (0.000109, "a volume car's bus: 0.1 deg at the hand wheel"),
    },
    "wheel_speed": {
        "noise": (0.08, "a volume car's bus: 0.1 %, here of 90 km/h"),
        "range": (270.0, "chosen: 300 km/h"),
        "quantum": (0.0067, "a volume car's bus: 0.0075 km/h"),
    },
    "brake_pressure": {
        "bandwidth": (50.0, "chosen: a pressure sensor of a hydraulic unit"),
        "noise": (2e4, "chosen: 0.1 % of the range"),
        "range": (2.5e7, "chosen: 250 bar"),
        "quantum": (1e4, "chosen: 0.1 bar"),
    },
}

ProductionParameters = parameters_of(
    __name__,
    "ProductionParameters",
    PRODUCTION,
    common={
        "sample_time": parameter(
            0.01, "s", "Time between messages", "a volume car's bus: 10 ms", minimum=0.0
        ),
        "latency": parameter(
            0.005,
            "s",
            "Latency of every message",
            "chosen: half a message, of 5 to 20 ms in cars",
            minimum=0.0,
        ),
    },
)

_PRESSURE = "Pressure in the wheel's brake cylinder"
_ALWAYS = ("yaw_rate", "acceleration_x", "acceleration_y", "steer_angle", "wheel_speed_*")
_AT_TIMES = ("roll_angle", "pitch_angle", "slope", "bank")


class Production(Component):
    """Sensor cluster of a production car: gyro, accelerometers, wheel speeds, hand wheel, brakes."""

    Parameters = ProductionParameters
    sampled = True
    inputs = (
        *(signal(f"{name}_true", SIGNALS[name].unit, f"True: {SIGNALS[name].text}") for name in _ALWAYS),
        signal("brake_pressure_*_true", "Pa", f"True: {_PRESSURE}", optional=True),
        *(
            signal(f"{name}_true", SIGNALS[name].unit, f"True: {SIGNALS[name].text}", optional=True)
            for name in _AT_TIMES
        ),
    )
    outputs = (
        output("yaw_rate", "yaw_rate_true"),
        output("acceleration_x", "acceleration_x_true", "pitch_angle_true", "slope_true"),
        output("acceleration_y", "acceleration_y_true", "roll_angle_true", "bank_true"),
        output("steer_angle", "steer_angle_true"),
        output("wheel_speed_*", "wheel_speed_*_true"),
        output("brake_pressure_*", "brake_pressure_*_true", unit="Pa", text=_PRESSURE),
    )

    def configure(self) -> None:
        self.figures = figures_of(self.p)

    def start(self, t: float, u: list[float]) -> None:
        self.channels = [
            Channel(figures, key(self.p.seed, name), t, value)
            for (name, figures), value in zip(self._named(), self._felt(u), strict=True)
        ]

    def advance(self, t: float, h: float, u: list[float]) -> None:
        for channel, value in zip(self.channels, self._felt(u)):  # noqa: B905 - strict= costs a tenth
            channel.advance(t, h, value)

    def output(self, t: float, u: list[float]) -> list[float]:
        return [channel.received for channel in self.channels]

    def _named(self) -> list[tuple[str, ChannelSpec]]:
        """Return name and properties of every channel, in the order of the outputs."""
        named = []
        for name, figures in self.figures.items():
            pattern = f"{name}_*" if name in ("wheel_speed", "brake_pressure") else name
            named += [(channel, figures) for channel in wheels(pattern)]
        return named

    def _felt(self, u: list[float]) -> list[float]:
        """Return the physical inputs of the sensors, in the order of the outputs; equation (1)."""
        r, a_x, a_y, *others, roll, pitch, slope, bank = u
        if self.p.feels_gravity:
            theta, phi = pitch - slope, roll + bank
            a_x = a_x * cos(theta) - G * sin(theta)
            a_y = a_y * cos(phi) + G * sin(phi)
        return [r, a_x, a_y, *others]
