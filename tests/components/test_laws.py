"""Laws of the field: feedforward and PI, super-twisting, integral sliding mode, internal model, LQG."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import brentq, fsolve

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.control_laws.linear_feedback import error_dynamics, optimal_gains
from yawbench.components.control_laws.saturating_axles import axle_forces, holding_moment, tyre_moment
from yawbench.components.control_laws.sideslip_bound import sideslip_bound
from yawbench.components.controllers.feedforward_pi import FeedforwardPi, gains_for_crossover
from yawbench.components.controllers.integral_sliding_mode import IntegralSlidingMode
from yawbench.components.controllers.internal_model import InternalModel
from yawbench.components.controllers.lqg import Lqg, LqgParameters
from yawbench.components.estimation.linear_filter import LinearFilter, Noise
from yawbench.components.mathematics.super_twisting import SuperTwisting

from .stand import Stand
from .test_baselines import CARS

every_car = pytest.mark.parametrize("car", CARS.values(), ids=CARS)


def known(car: SingleTrackCar) -> dict[str, float]:
    """Return the parameters by which a controller knows a car."""
    return {
        "mass": car.m,
        "yaw_inertia": car.i_z,
        "cg_to_front_axle": car.a,
        "cg_to_rear_axle": car.b,
        "cornering_stiffness_front": car.c_f,
        "cornering_stiffness_rear": car.c_r,
    }


# Feedforward and PI


@every_car
@pytest.mark.parametrize("v", [8.0, 25.0, 40.0])
def test_the_loop_of_the_scheduled_pi_crosses_over_where_asked(car, v):
    w_c, t_i = 12.0, 0.4
    a, b = np.array(error_dynamics(car, v)), np.array([0.0, 1.0 / car.i_z])
    plant = np.linalg.solve(1j * w_c * np.eye(2) - a, b)[1]
    k_p, k_i, _ = gains_for_crossover(car, v, w_c, t_i)
    assert abs((k_p + k_i / (1j * w_c)) * plant) == pytest.approx(1.0, rel=1e-9)
    assert k_p / k_i == pytest.approx(t_i)


@every_car
@pytest.mark.parametrize(("r", "delta", "mu"), [(0.2, 0.03, 0.9), (-0.15, 0.1, 0.5), (0.3, 0.25, 0.9)])
def test_the_holding_moment_is_the_equilibrium_that_a_solver_finds(car, r, delta, mu):
    v = 22.0

    def rates(x):
        front, rear = axle_forces(car, x[0], r, delta=delta, v=v, mu=mu)
        return front + rear - car.m * v * r, car.a * front - car.b * rear + 1e3 * x[1]

    solution, _, found, why = fsolve(rates, (0.0, 0.0), full_output=True, xtol=1e-12)
    assert found == 1, why
    assert holding_moment(car, r, delta=delta, v=v, mu=mu) == pytest.approx(1e3 * solution[1], abs=0.01)


@every_car
def test_a_turn_that_the_car_takes_by_itself_needs_no_moment(car):
    delta, v = 1e-4, 20.0
    r = car.gains(v)[0] * delta
    needed = holding_moment(car, r, delta=delta, v=v, mu=1.0)
    assert abs(needed) < 1e-4 * abs(holding_moment(car, 2.0 * r, delta=delta, v=v, mu=1.0))
    assert tyre_moment(car, 0.0, 0.0, delta=delta, v=v, mu=1.0) == pytest.approx(
        car.a * car.c_f * delta, rel=1e-4
    )


def test_a_yaw_rate_beyond_the_road_gives_the_moment_of_sliding_axles():
    car = CARS["understeering"]
    wanted = holding_moment(car, 2.0, delta=0.0, v=30.0, mu=0.5)
    assert abs(wanted) < 0.02 * 0.5 * car.m * 9.81 * car.a * car.b / (car.a + car.b)  # arms balance


def test_its_integral_never_moves_the_moment_beyond_the_limit_and_comes_back_at_once():
    stand = Stand(FeedforwardPi, moment_limit=3000.0, feedforward_share=0.0, sideslip_gain=0.0)
    stand.start(velocity_x=25.0)
    for _ in range(400):
        assert stand.step(0.005, velocity_x=25.0, yaw_rate_ref=0.5)["yaw_moment"] == 3000.0
    assert stand.step(0.005, velocity_x=25.0, yaw_rate_ref=-0.05)["yaw_moment"] < 0.0


def test_sideslip_counts_beyond_its_bound_alone():
    stand = Stand(FeedforwardPi, feedforward_share=0.0, sideslip_gain=60000.0)
    stand.start(velocity_x=25.0, friction=0.9)
    bound = sideslip_bound(0.9)
    straight = {"velocity_x": 25.0, "friction": 0.9}
    assert stand.step(0.005, **straight, sideslip=bound - 0.01)["yaw_moment"] == 0.0
    beyond = stand.step(0.005, **straight, sideslip=bound + 0.01)["yaw_moment"]
    assert beyond == pytest.approx(600.0)


# Super-twisting


def twisted(h: float, k_2: float = 1.1 * 20.0, duration: float = 2.0):
    """Return times, s, integral and control for a disturbance whose rate reaches L = 20."""
    law = SuperTwisting(1.5 * math.sqrt(20.0), k_2)
    s, rows = 0.3, []
    for k in range(round(duration / h)):
        u = law.see(s, h, -math.inf, math.inf)
        t = k * h
        # the integral of d = 5 sin(4 t) over the sample, exactly
        s += 1.25 * (math.cos(4.0 * t) - math.cos(4.0 * (t + h))) - h * u
        rows.append((t + h, s, law.integral, u))
    return np.array(rows).T


def test_super_twisting_reaches_zero_in_finite_time_and_stays_with_accuracy_of_second_order():
    late = []
    for h in (1e-3, 5e-4):
        t, s, integral, control = twisted(h)
        after = t > 1.0
        late.append(np.abs(s[after]).max())
        assert np.abs(s[t < 0.1]).max() > 0.05  # it was not there from the start
        assert np.abs(integral[after] - 5.0 * np.sin(4.0 * t[after])).max() < 40.0 * h  # w is the disturbance
        assert late[-1] <= 1.001 * 20.0 * h * h
        assert (
            np.abs(np.diff(control[after])).sum() < 1.01 * np.abs(np.diff(5.0 * np.sin(4.0 * t[after]))).sum()
        )
    assert late[0] / late[1] == pytest.approx(4.0, rel=0.1)  # Levant 1993: of second order in the sample


def test_the_sampled_super_twisting_solves_the_implicit_equation():
    """The end of the sample with the disturbance at w, as a solver finds it."""
    rng = np.random.default_rng(8)
    h, k_1, k_2 = 0.01, 4.0, 30.0
    for s in map(float, [*rng.uniform(-0.5, 0.5, 50), *rng.uniform(-3e-3, 3e-3, 20)]):
        law = SuperTwisting(k_1, k_2)
        law.integral = w = float(rng.uniform(-20.0, 20.0))
        u = law.see(s, h, -math.inf, math.inf)
        end = s + h * (w - u)
        if abs(s) > 2.0 * h * h * k_2:

            def left(end, s=s):
                sigma = math.copysign(1.0, s)
                return end - s + h * sigma * (k_1 * math.sqrt(abs(end)) + 2.0 * h * k_2)

            assert end == pytest.approx(brentq(left, 0.0, s, xtol=1e-15), abs=1e-9)
        assert law.integral - w == pytest.approx(np.clip(s / (h * h * k_2), -1, 1) * h * k_2)


def test_beyond_the_limit_the_integral_only_moves_back():
    law = SuperTwisting(5.0, 20.0)
    for _ in range(100):
        law.see(0.5, 0.01, -3.0, 3.0)
    assert law.integral == 0.0
    law.see(-0.5, 0.01, -30.0, 30.0)
    assert law.integral < 0.0


# Integral sliding mode


@pytest.mark.parametrize("perturbation", [lambda t: 2.0, lambda t: 1.5 + 2.0 * math.sin(3.0 * t)])
def test_the_yaw_rate_follows_the_nominal_law_from_the_start_whatever_the_perturbation(perturbation):
    """Of a car with tyres as known, the perturbation an unknown yaw acceleration [rad/s2]."""
    car, v, h, k = CARS["understeering"], 25.0, 0.001, 10.0

    def follow(switching_gain):
        stand = Stand(
            IntegralSlidingMode,
            **known(car), tracking_rate=k, switching_gain=switching_gain, boundary_layer=0.02,
            filter_time=0.001, moment_limit=1e6,
        )  # fmt: skip
        r, worst, sigma = 0.0, 0.0, 0.0
        seen = {"yaw_rate_ref": 0.3, "velocity_x": v, "friction": 0.9}
        moment = stand.start(**seen)["yaw_moment"]
        for step in range(1000):
            t = step * h
            tyres = tyre_moment(car, 0.0, r, delta=0.0, v=v, mu=0.9)
            r += h * ((tyres + moment) / car.i_z + perturbation(t))
            outputs = stand.step(h, **seen, yaw_rate=r)
            moment = outputs["yaw_moment"]
            worst = max(worst, abs(r - 0.3 * (1.0 - math.exp(-k * (t + h)))))
            sigma = max(sigma, abs(outputs["sliding_surface"]))
        return worst, sigma

    with_it, sigma = follow(5.0)
    without, _ = follow(0.0)
    assert sigma < 0.02  # inside of the boundary layer from the start, there is no reaching phase
    assert with_it < 0.02
    assert without > 0.1


# Internal model


@every_car
def test_a_car_like_the_model_has_the_filters_response(car):
    """Step of the reference, and the same car steered: what the steering does decays with the filter, too."""
    v, h, lam = 15.0, 0.001, 0.1
    a, b = np.array(error_dynamics(car, v)), np.array([0.0, 1.0 / car.i_z])
    steered = np.array(car.derivatives(0.0, 0.0, delta=0.02, v=v))

    def respond(r_ref, forced):
        whole = np.zeros((4, 4))
        whole[:2, :2], whole[:2, 2], whole[:2, 3] = a, b, forced
        step = expm(whole * h)
        stand = Stand(InternalModel, **known(car), filter_time=lam, moment_limit=1e6)
        moment = stand.start(velocity_x=v, yaw_rate_ref=r_ref)["yaw_moment"]
        x, rates = np.zeros(2), []
        for _ in range(1500):
            x = step[:2] @ [*x, moment, 1.0]
            rates.append(x[1])
            moment = stand.step(h, velocity_x=v, yaw_rate_ref=r_ref, yaw_rate=x[1])["yaw_moment"]
        return np.array(rates)

    t = h * np.arange(1, 1501)
    filtered = 0.2 * (1.0 - np.exp(-t / lam))
    assert np.abs(respond(0.2, np.zeros(2)) - filtered).max() < 0.2 * 2.0 * h / lam
    free = solve_ivp(lambda _, x: a @ x + steered, (0.0, 1.5), (0.0, 0.0), t_eval=t, rtol=1e-9).y[1]
    rising = np.gradient(free, h)
    left = solve_ivp(  # (1 - F) d
        lambda now, y: np.interp(now, t, rising) - y / lam,
        (0.0, 1.5),
        (0.0,),
        t_eval=t,
        rtol=1e-6,
        max_step=0.01,
    ).y[0]
    assert np.abs(respond(0.0, steered) - left).max() < 0.02 * np.abs(free).max() + 2e-3


def test_the_model_of_an_oversteering_car_is_stable_beyond_its_critical_speed():
    car = CARS["oversteering"]
    stand = Stand(InternalModel, **known(car))
    stand.start(velocity_x=50.0, yaw_rate_ref=0.1)
    unit = stand.unit
    assert max(np.linalg.eigvals(np.array(error_dynamics(car, 50.0))).real) > 0.0
    assert max(np.linalg.eigvals(np.array(error_dynamics(car, unit.speed))).real) < 0.0


def test_a_limited_moment_does_not_wind_up_the_model():
    """However long the limit was reached, the law comes back from it in the same way."""

    def back(samples):
        stand = Stand(InternalModel, moment_limit=1000.0)
        stand.start(velocity_x=25.0)
        for _ in range(samples):
            assert stand.step(0.005, velocity_x=25.0, yaw_rate_ref=0.5)["yaw_moment"] == 1000.0
        return [stand.step(0.005, velocity_x=25.0, yaw_rate_ref=-0.2)["yaw_moment"] for _ in range(20)]

    assert back(2000) == pytest.approx(back(400), abs=1.0)
    assert back(400)[0] < 0.0


# LQG


NOISE = Noise(0.05, 1.0, 0.005, 0.5)


@every_car
@pytest.mark.parametrize("v", [10.0, 30.0])
def test_the_kalman_gain_is_that_of_the_riccati_equation(car, v):
    h = 0.005
    a = np.array(error_dynamics(car, v))
    phi = expm(a * h)
    c = np.array([[0.0, 1.0], [v * a[0, 0], v * (a[0, 1] + 1.0)]])
    noise = np.diag([NOISE.gyro**2, NOISE.accelerometer**2])
    p = solve_discrete_are(phi.T, c.T, h * np.diag([NOISE.beta**2, NOISE.r**2]), noise)
    gain = p @ c.T @ np.linalg.inv(c @ p @ c.T + noise)
    settled = LinearFilter(car, NOISE)
    for _ in range(4000):
        settled.correct(v=v, delta=0.0, r=0.0, a_y=0.0)
        settled.predict(h, v=v, delta=0.0, moment=0.0)
    assert np.allclose([[settled.p_11, settled.p_12], [settled.p_12, settled.p_22]], p, rtol=1e-6, atol=1e-12)
    for measured, column in (((1.0, 0.0), 0), ((0.0, 1.0), 1)):
        settled.beta = settled.r = 0.0
        kept = settled.p_11, settled.p_12, settled.p_22
        settled.correct(v=v, delta=0.0, r=measured[0], a_y=measured[1])
        assert (settled.beta, settled.r) == pytest.approx(tuple(gain[:, column]), rel=1e-6)
        settled.p_11, settled.p_12, settled.p_22 = kept


def test_the_filter_finds_the_sideslip_of_a_linear_car_from_a_wrong_beginning():
    car, v, h = CARS["understeering"], 25.0, 0.005
    a = np.array(error_dynamics(car, v))
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2], whole[:2, 3] = (
        a,
        car.derivatives(0.0, 0.0, delta=1.0, v=v),
        (0.0, 1.0 / car.i_z),
    )
    step = expm(whole * h)[:2]
    state, believed = np.array([0.03, 0.2]), LinearFilter(car, NOISE)
    believed.p_11 = believed.p_22 = 1.0
    delta = moment = 0.0
    for k in range(400):
        a_y = v * (car.derivatives(*state, delta=delta, v=v)[0] + state[1])
        believed.correct(v=v, delta=delta, r=state[1], a_y=a_y)
        delta, moment = 0.02 * math.sin(0.01 * k), 500.0 * math.cos(0.02 * k)
        believed.predict(h, v=v, delta=delta, moment=moment)
        state = step @ [*state, delta, moment]
    assert (believed.beta, believed.r) == pytest.approx(tuple(state), abs=1e-6)


def test_lqg_uses_the_gains_of_the_regulator_on_its_estimates():
    stand = Stand(Lqg, moment_limit=1e6)
    stand.start(velocity_x=25.0)
    for k in range(50):
        seen = {"yaw_rate": 0.01 * math.sin(0.1 * k), "yaw_rate_ref": 0.02, "acceleration_y": 0.3}
        outputs = stand.step(0.005, velocity_x=25.0, **seen)
    p = LqgParameters()
    car = SingleTrackCar.of(p, p.yaw_inertia)
    k_beta, k_r = optimal_gains(
        error_dynamics(car, 25.0), car.i_z,
        beta_0=p.sideslip_scale, r_0=p.yaw_rate_scale, moment_0=p.moment_scale,
    )  # fmt: skip
    believed = stand.unit.filter
    assert outputs["estimated_sideslip"] == believed.beta != 0.0
    assert outputs["yaw_moment"] == pytest.approx(k_beta * -believed.beta + k_r * (0.02 - believed.r))
