"""Standard tests as environments: what Gymnasium requires, what the regulation says, what a run comes to."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import yawbench as yb
import yawbench.gym
from tests.checkout import ROOT
from tests.refusals import mentions, refused
from yawbench.proving_ground.sine_with_dwell import SPUN, amplitudes

LEAST = amplitudes(yawbench.gym.ANGLE)[0]
SEVEREST = amplitudes(yawbench.gym.ANGLE)[-1]


def damping(observation: np.ndarray) -> float:
    """Return an action against the error of the yaw rate."""
    return 8.0 * (observation[0] - observation[2])


@pytest.fixture
def env():
    with_spec = gymnasium.make(yawbench.gym.ID)
    yield with_spec
    with_spec.close()


def episode(env: Any, policy: Any, **reset: Any) -> tuple[list[np.ndarray], float, dict[str, Any]]:
    """Return the observations, the sum of rewards and the last info of an episode."""
    observation, _ = env.reset(**reset)
    observations, total, over, info = [observation], 0.0, False, {}
    while not over:
        observation, reward, terminated, truncated, info = env.step([policy(observation)])
        observations.append(observation)
        total, over = total + reward, terminated or truncated
    return observations, total, info


def test_it_passes_the_check_of_gymnasium(env):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*space (min|max)imum value is -?infinity.*")
        check_env(env.unwrapped)


def test_an_episode_is_the_run_of_the_policy_as_a_controller(env):
    for amplitude in (SEVEREST, -LEAST):
        observations, total, info = episode(env, damping, options={"amplitude": amplitude})
        controller = yawbench.gym.as_controller(damping)
        scenario = yb.load(yawbench.gym.SCENARIO).set({"driver.amplitude": amplitude})
        run = scenario.swap(controller=controller).run()
        judged = run.evaluate("sine-with-dwell", angle=yawbench.gym.ANGLE).criteria
        margins = {name: verdict.margin for name, verdict in judged.items() if verdict.holds is not None}
        assert ("responsiveness" in margins) == (abs(amplitude) == SEVEREST)
        assert total == max(-1.0, min(1.0, *margins.values(), 1.0))
        assert info["passed"] == all(verdict.holds is not False for verdict in judged.values())
        every = round(0.005 / (run.time[1] - run.time[0]))
        samples = len(run.time[::every]) - 1
        assert len(observations) == samples + 1  # each observation, and the last one again
        sideslip = [observation[3] for observation in observations[:samples]]
        assert set(sideslip) <= set(run["plant.sideslip"]) | {0.0}


def test_the_same_seed_gives_the_same_episode(env):
    chosen = [env.reset(seed=seed)[1]["amplitude"] for seed in (1, 1, 2, 3, 4)]
    assert chosen[0] == chosen[1]
    assert len(set(chosen)) > 2
    assert {abs(amplitude) for amplitude in chosen} <= set(amplitudes(yawbench.gym.ANGLE))
    first, second = ([env.reset(seed=1)[0], *(env.step([0.3])[0] for _ in range(50))] for _ in range(2))
    assert np.array_equal(first, second)


def test_a_car_that_spins_ends_the_episode_with_the_worst_reward(env):
    observations, total, info = episode(env, lambda x: 8.0 * x[2], options={"amplitude": SEVEREST})
    assert (total, info["passed"]) == (-1.0, False)
    assert abs(observations[-1][3]) > SPUN
    assert all(abs(observation[3]) <= SPUN for observation in observations[:-1])
    with pytest.raises(RuntimeError, match="reset"):
        env.unwrapped.step([0.0])


def test_no_run_is_left_behind(env):
    before = threading.active_count()
    for seed in range(3):
        env.reset(seed=seed)
        env.step([0.0])
    assert threading.active_count() == before + 1
    env.close()
    assert threading.active_count() == before


@pytest.mark.parametrize("count", [2, pytest.param(200, marks=pytest.mark.exhaustive)])
def test_episodes_of_a_random_policy_run_in_two_workers(count):
    workers = gymnasium.make_vec(yawbench.gym.ID, num_envs=2, vectorization_mode="async")
    rewards: list[float] = []
    try:
        workers.reset(seed=1)
        workers.action_space.seed(1)
        while len(rewards) < count:
            _, reward, terminated, truncated, _ = workers.step(workers.action_space.sample())
            assert not truncated.any()
            rewards += reward[terminated].tolist()
    finally:
        workers.close()
    assert all(-1.0 <= reward <= 1.0 for reward in rewards)
    assert count == 2 or min(rewards) < max(rewards)


def test_a_policy_is_ranked_like_any_controller():
    damped = yawbench.gym.as_controller(damping)
    places = yb.rank(damped, name="damped", against=["none"], conditions=["hard"], quick=True)
    assert [*places.table["entry"]] == ["damped", "none"]


@pytest.mark.exhaustive
def test_the_hand_wheel_angle_is_that_of_the_cars_own_test():
    run = yb.load("proving_ground/slowly_increasing_steer").run()
    angle = run.evaluate("slowly-increasing-steer").quantities["angle"].value
    assert angle == pytest.approx(yawbench.gym.ANGLE, rel=1e-4)


@pytest.mark.parametrize(
    ("wrong", "kind", "names"),
    [
        ({"angle": 0.0}, yb.ScenarioError, ("angle", "0")),
        ({"largest": math.nan}, ValueError, ("largest", "finite", "number")),
        ({"signals": ["yawrate"]}, yb.ScenarioError, ("'yaw_rate'",)),
        ({"signals": []}, ValueError, ("signals", "empty")),
        ({"scenario": "nothing"}, yb.ScenarioError, ("nothing",)),
        ({"render_mode": "human"}, ValueError, ("render_mode", "None")),
    ],
)
def test_what_is_wrong_is_named(wrong, kind, names):
    with refused(kind, names=names):
        yawbench.gym.SineWithDwell(**wrong)


@pytest.mark.parametrize(
    "action, names", [([math.nan], ("[nan]",)), ([0.1, 0.2], ("[0.1, 0.2]",)), ([math.inf], ("[inf]",))]
)
def test_an_action_is_one_finite_number(env, action, names):
    env.reset(seed=1)
    with pytest.raises(ValueError) as caught:
        env.unwrapped.step(action)
    assert mentions(caught.value, "action", "-1", *names)


def test_without_gymnasium_one_sentence_says_what_to_install():
    code = "import sys; sys.modules['gymnasium'] = None; import yawbench.gym"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert mentions(
        done.stderr.splitlines()[-1], "ImportError", "yawbench.gym", "Gymnasium", '"yawbench[gym]"'
    )
