"""Slip control: the law, and wheels that neither lock nor spin."""

from __future__ import annotations

from itertools import pairwise, product
from math import isfinite, pi, sin

import pytest

from yawbench.components.control_laws.slip_control import SlipControlParameters, slip_torque, wheel_torque
from yawbench.components.tyre_models.slip_curve import slip_for_force
from yawbench.components.wheel_controls.slip import Slip, SlipParameters
from yawbench.vocabulary.wheels import WHEELS

from .stand import Stand, four, wheel_values
from .tyre_curves import CAP, curve_of, slip_limits, tyre_curve


def test_the_torque_gives_the_slip_rate_asked_for_in_both_branches():
    # Against the derivative of the slip's own definition along the motion it causes.
    p = SlipControlParameters()
    radius, inertia, v, dv, f_x = p.wheel_radius, p.wheel_inertia, 15.0, -2.5, -900.0
    for direction in (1.0, -1.0):
        for kappa, target in ((-0.08, -0.05), (-0.02, -0.1), (0.06, 0.03), (0.3, 0.1)):
            ground, rate_of_ground = direction * v, direction * dv
            signed, wanted = direction * kappa, direction * target
            rolling = ground * (1.0 + kappa) if kappa < 0.0 else ground / (1.0 - kappa)
            torque = slip_torque(signed, wanted, f_x, v=ground, dv=rate_of_ground, p=p)
            dw = (torque - radius * f_x) / inertia
            h = 1e-6

            def slip(t, rolling=rolling, ground=ground, dw=dw, dv=rate_of_ground):
                w_r, v_t = rolling + radius * dw * t, ground + dv * t
                return (w_r - v_t) / max(abs(w_r), abs(v_t))

            s = wanted - signed
            asked = max(-1.0, min(1.0, s / p.boundary_layer)) + p.slip_gain * s
            assert slip(0.0) == pytest.approx(signed, rel=1e-12)
            assert (slip(h) - slip(-h)) / (2 * h) == pytest.approx(asked, rel=1e-6)


def torque_of(request, kappa=0.0, *, w, v, dv=0.0, f_z=4000.0, mu=0.8, h=0.001, **given):
    p = SlipParameters(**given)
    curve = curve_of(p, "front", 0.0, f_z, mu)
    return wheel_torque(request, kappa, curve, w=w, v=v, dv=dv, sample_time=h, p=p)[0]


R = 0.313


@pytest.mark.parametrize(
    ("request_", "kappa", "w", "v", "torque"),
    [
        *((0.0, kappa, v / R, v, 0.0) for kappa, v in ((0.0, 20.0), (-0.01, 20.0), (0.02, 20.0), (0.0, 0.0))),
        (-50.0, -0.03, 60.0, 20.0, -50.0 * R),
        (-900.0, -0.03, 2.0, 1.0, -900.0 * R),  # a slow wheel
        (900.0, 0.0, 0.0, 0.0, 900.0 * R),
        (-2000.0, 0.0, 0.0, 0.0, 0.0),  # nothing drives the car backwards
        *((-2000.0, k, v / R, v, 0.0) for k, v in ((0.0, -5.0), (-0.2, -5.0), (0.3, -5.0), (0.0, -0.5))),
    ],
)
def test_small_requests_and_slow_wheels_get_force_times_radius_and_others_none(request_, kappa, w, v, torque):
    dv = 0.0 if request_ else -3.0
    assert torque_of(request_, kappa, w=w, v=v, dv=dv) == pytest.approx(torque, rel=1e-4)


def test_the_fades_leave_no_jump():
    for low, high in (((-50.0, 20.0), (-50.1, 20.0)), ((-100.0, 20.0), (-100.1, 20.0))):
        a, b = [torque_of(request, -0.03, w=60.0, v=v, brake_torque_limit=1e6) for request, v in (low, high)]
        assert a == pytest.approx(b, abs=1.0)
    for v in (1.0, 3.0):
        a, b = [torque_of(-900.0, -0.03, w=3.0, v=v + dv) for dv in (-1e-4, 1e-4)]
        assert a == pytest.approx(b, abs=0.1)


def test_a_braked_wheel_gets_no_torque_that_would_reverse_it():
    for kappa, w, v in product((-1.0, -0.8, -0.2), (0.0, 0.01, 0.5), (0.0, 0.05, 1.5, 10.0)):
        torque = torque_of(-4000.0, kappa, w=w, v=v, h=0.002)
        if torque < 0.0:
            force, _ = tyre_curve(0.0, 4000.0, 0.8)
            assert w + 0.002 * (torque - 0.313 * force(kappa)) / 2.1 >= -1e-12


def test_a_car_that_rolls_backwards_is_held_by_a_forward_request():
    assert torque_of(2000.0, 0.0, w=-5.0 / 0.313, v=-5.0) > 0.0


def test_torques_keep_their_limits_and_stay_finite_whatever_comes_in():
    for request, kappa, v, w in product(
        (-1e6, -900.0, 0.0, 3e3, 1e9), (-2.0, -1.0, 0.0, 0.9, 1.0), (0.0, 40.0), (-9.0, 300.0)
    ):
        for f_z, mu in ((0.0, 1.0), (1e5, 1.0), (4000.0, 0.0)):
            torque = torque_of(request, kappa, w=w, v=v, f_z=f_z, mu=mu, dv=-50.0)
            assert isfinite(torque)
            assert -3300.0 <= torque <= 800.0


def test_a_wheel_in_the_air_is_kept_at_the_cap():
    assert torque_of(-1000.0, -CAP, w=(1.0 - CAP) * 20.0 / 0.313, v=20.0, f_z=0.0) == pytest.approx(
        0.0, abs=1e-9
    )
    assert torque_of(-1000.0, -0.40, w=0.60 * 20.0 / 0.313, v=20.0, f_z=0.0) > 0.0


class QuarterCar:
    """A quarter of paper B's car on one wheel, integrated in steps of 0.1 ms between samples."""

    def __init__(self, v, *, mu, ts, locked=False):
        self.v, self.mu, self.ts = v, mu, ts
        self.w = 0.0 if locked else v / 0.313
        self.load = 1350.0 * 9.81 / 4
        self.force, _ = tyre_curve(0.0, self.load, mu)

    @property
    def kappa(self):
        rolling = self.w * 0.313
        return (rolling - self.v) / max(abs(rolling), abs(self.v), 0.5)

    def inputs(self, request):
        values = {
            "force_request": request,
            "slip_ratio": self.kappa,
            "vertical_load": self.load,
            "wheel_speed": self.w,
            "wheel_velocity": self.v,
            "friction": self.mu,
        }
        return {f"{name}_{wheel}": value for name, value in values.items() for wheel in WHEELS}

    def hold(self, torque):
        steps = round(self.ts / 1e-4)
        for _ in range(steps):
            f_x = self.force(self.kappa)
            w = self.w + 1e-4 * (torque - 0.313 * f_x) / 2.1
            self.w = max(w, 0.0) if torque < 0.0 else w
            self.v = max(self.v + 1e-4 * f_x / (1350.0 / 4), 0.0)

    def run(self, request, until):
        """Return (kappa, torque, speed) at every sample; request [N] is a function of time [s]."""
        stand = Stand(Slip)
        stand.start(**self.inputs(request(0.0)))
        rows = []
        for i in range(round(until / self.ts)):
            torque = stand.step(self.ts, **self.inputs(request(i * self.ts)))["torque_request_fl"]
            self.hold(torque)
            rows.append((self.kappa, torque, self.v))
        return rows


@pytest.mark.parametrize("ts", [0.001, 0.002, 0.005])
def test_braking_beyond_the_grip_settles_at_the_limit_without_a_limit_cycle(ts):
    rows = QuarterCar(80.0 / 3.6, mu=0.3, ts=ts).run(lambda t: -1500.0, 1.5)
    (limit,), grid = slip_limits(tyre_curve(0.0, 1350.0 * 9.81 / 4, 0.3)[0], -1.0)
    assert max(abs(kappa) for kappa, _, _ in rows) < 0.05
    late = rows[len(rows) // 3 :]
    assert all(kappa == pytest.approx(-limit, abs=grid) for kappa, _, _ in late)
    assert sum(abs(b[1] - a[1]) for a, b in pairwise(late)) < 1.0
    assert rows[-1][2] < 17.0


def test_a_locked_wheel_is_brought_back():
    rows = QuarterCar(80.0 / 3.6, mu=0.3, ts=0.001, locked=True).run(lambda t: -1500.0, 0.6)
    assert rows[-1][0] == pytest.approx(-0.043, abs=0.001)


def test_driving_beyond_the_grip_does_not_spin_the_wheel():
    rows = QuarterCar(5.0, mu=0.3, ts=0.001).run(lambda t: 1500.0, 1.5)
    assert max(abs(kappa) for kappa, _, _ in rows) < 0.05
    assert rows[-1][2] > 9.8


def test_a_force_within_the_grip_is_delivered():
    car = QuarterCar(80.0 / 3.6, mu=0.3, ts=0.002)
    car.run(lambda t: -700.0, 0.5)
    assert car.force(car.kappa) == pytest.approx(-700.0, rel=1e-3)


def test_a_changing_force_is_followed():
    car = QuarterCar(80.0 / 3.6, mu=1.0, ts=0.001)
    rows = car.run(lambda t: -1500.0 * sin(2.0 * pi * t), 1.0)
    errors = [
        car.force(kappa) + 1500.0 * sin(2.0 * pi * 0.001 * (i + 1)) for i, (kappa, _, _) in enumerate(rows)
    ]
    assert max(map(abs, errors)) < 0.12 * 1500.0


def test_braking_ends_at_rest_and_stays_there():
    rows = QuarterCar(6.0, mu=0.8, ts=0.001).run(lambda t: -2000.0, 2.0)
    assert max(abs(kappa) for kappa, _, _ in rows) < 0.1
    assert all(v < 1e-9 and abs(torque) < 1e-6 for _, torque, v in rows[-300:])


def test_the_unit_gives_each_wheel_its_own_torque_and_shows_its_slip_target():
    stand = Stand(Slip, slip_stiffness_scale_rear=1.2)
    common = {"slip_ratio": 0.0, "slip_angle": 0.0, "vertical_load": 4000.0, "wheel_speed": 60.0}
    common |= {"wheel_velocity": 60.0 * 0.313, "friction": 1.0}
    given = {f"{n}_{w}": x for n, x in common.items() for w in WHEELS}
    out = stand.start(**given, **four("force_request", -1000.0, 500.0, -1000.0, 0.0))
    targets = wheel_values(out, "slip_ratio_target")
    assert targets[0] == pytest.approx(-1000.0 / 86040.0, rel=0.05)
    assert targets[2] == pytest.approx(targets[0] / 1.2, rel=0.02)
    assert targets[1] > 0.0 == targets[3]
    torques = wheel_values(out, "torque_request")
    assert torques[0] < torques[2] < 0.0 == torques[3] < torques[1]


def test_the_share_of_the_slip_is_one_at_095_of_the_optimum_of_each_wheel_whatever_is_asked_for():
    stand = Stand(Slip)
    wheels = {"fl": (4000.0, 0.0, 1.0), "fr": (2000.0, 0.1, 0.3), "rl": (6000.0, -0.05, 0.6)}
    given, limits = {}, {}
    for wheel, (f_z, alpha, mu) in wheels.items():
        force = tyre_curve(alpha, f_z, mu)[0]
        grid = [k / 2000 for k in range(1, 2000)]
        limits[wheel] = 0.95 * max(grid, key=lambda kappa, force=force: -force(-kappa))
        given |= {f"vertical_load_{wheel}": f_z, f"slip_angle_{wheel}": alpha, f"friction_{wheel}": mu}
        given |= {f"wheel_speed_{wheel}": 60.0, f"wheel_velocity_{wheel}": 60.0 * 0.313}
    stand.start(**given)
    for part in (0.5, 1.0, 1.3):
        slips = {f"slip_ratio_{wheel}": -part * limit for wheel, limit in limits.items()}
        for request in (0.0, -500.0):
            asked = {f"force_request_{wheel}": request for wheel in wheels}
            out = stand.step(0.001, **slips, **asked)
            for wheel in wheels:
                assert out[f"slip_share_{wheel}"] == pytest.approx(part, rel=0.01)
    assert stand.step(0.001)["slip_share_rr"] == 0.0


def test_the_wheels_acceleration_is_its_filtered_difference():
    stand = Stand(Slip, acceleration_filter=0.0, switching_gain=0.0, slip_gain=0.0)
    given = {"slip_ratio_fl": -0.01, "vertical_load_fl": 4000.0, "friction_fl": 1.0, "wheel_speed_fl": 60.0}
    stand.start(force_request_fl=-1000.0, wheel_velocity_fl=20.0, **given)
    steady = stand.step(0.001)["torque_request_fl"]
    slowing = stand.step(0.001, wheel_velocity_fl=19.995)["torque_request_fl"]
    assert slowing - steady == pytest.approx(2.1 / 0.313 * 0.99 * -5.0, rel=1e-6)


def test_the_law_has_no_memory_but_the_acceleration():
    stand = Stand(Slip)
    given = {f"{n}_fl": x for n, x in (("slip_ratio", -0.02), ("vertical_load", 3e3), ("friction", 0.4))}
    given |= {"wheel_speed_fl": 60.0, "wheel_velocity_fl": 19.0, "slip_angle_fl": 0.03}
    first = stand.start(force_request_fl=-800.0, **given)
    stand.step(0.001, force_request_fl=3000.0)
    assert stand.step(0.001, force_request_fl=-800.0) == first


def test_a_first_slip_that_is_not_a_number_ends_at_the_cap():
    assert slip_for_force(100.0, lambda kappa: 0.0, first=float("nan"), cap=0.5, share=0.8) == 0.5
