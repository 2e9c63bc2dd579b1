"""Fuzzy neural network controller: its output, its gradient, its learning."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from tests.components.stand import Stand
from yawbench.components.controllers import fnn
from yawbench.components.controllers.fnn import (
    CENTRES,
    Fnn,
    firing_strengths,
    initial_weights,
    normalised_grades,
    set_gradients,
)


def any_network(seed: int):
    """A network as after long learning: inputs, weights, centres, widths."""
    g = random.Random(seed)
    x = [g.uniform(-1.0, 1.0), g.uniform(-1.0, 1.0)]
    weights = [w + g.uniform(-0.5, 0.5) for w in initial_weights()]
    centres = [[c + g.uniform(-0.1, 0.1) for c in CENTRES] for _ in range(2)]
    widths = [[g.uniform(0.15, 0.4) for _ in CENTRES] for _ in range(2)]
    return x, weights, centres, widths


def network_output(x, weights, centres, widths) -> float:
    """u of the inputs x_1, x_2 by the normalised strengths."""
    strengths = firing_strengths(*map(normalised_grades, x, centres, widths))
    return sum(strength * weight for strength, weight in zip(strengths, weights, strict=True))


def rule_by_rule(x, weights, centres, widths) -> float:
    """Equations (24)-(27) written out."""
    total = out = 0.0
    for j in range(7):
        for k in range(7):
            strength = math.exp(-(((x[0] - centres[0][j]) / widths[0][j]) ** 2)) * math.exp(
                -(((x[1] - centres[1][k]) / widths[1][k]) ** 2)
            )
            total += strength
            out += strength * weights[7 * j + k]
    return out / total


def moved(values, path, by):
    """A copy of nested lists with the number at `path` moved."""
    copy = [list(v) if isinstance(v, list) else v for v in values]
    place = copy
    for index in path[:-1]:
        place = place[index]
    place[path[-1]] += by
    return copy


SEEDS = range(5)


@pytest.mark.parametrize("seed", SEEDS)
def test_output_is_that_of_the_equations_written_out_rule_by_rule(seed):
    network = any_network(seed)
    assert network_output(*network) == pytest.approx(rule_by_rule(*network), abs=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("which", ["centres", "widths"])
def test_gradient_of_the_sets_agrees_with_finite_differences(seed, which):
    x, weights, centres, widths = any_network(seed)
    gradient = set_gradients(x, weights, centres, widths)[which == "widths"]
    step = 1e-5

    def at(i, j, by):
        sets = {"centres": centres, "widths": widths}
        sets[which] = moved(sets[which], [i, j], by)
        return rule_by_rule(x, weights, sets["centres"], sets["widths"])

    differences = [[(at(i, j, step) - at(i, j, -step)) / (2.0 * step) for j in range(7)] for i in range(2)]
    assert np.max(np.abs(np.subtract(gradient, differences))) < 1e-6
    assert np.max(np.abs(differences)) > 0.01


def see(e: float, rate: float = 0.0) -> dict[str, float]:
    return {"sideslip_ref": e, "sideslip": 0.0, "sideslip_rate_ref": rate, "sideslip_rate": 0.0}


def test_moment_is_that_of_the_network_behind_the_input_layer():
    e, rate = 0.0021, -0.013
    x = [
        (1.0 - math.exp(-e * 400.0)) / (1.0 + math.exp(-e * 400.0)),
        (1.0 - math.exp(-rate * 50.0)) / (1.0 + math.exp(-rate * 50.0)),
    ]
    expected = 5000.0 * rule_by_rule(x, initial_weights(), [CENTRES] * 2, [[0.24] * 7] * 2)
    assert Stand(Fnn).start(**see(e, rate))["yaw_moment"] == pytest.approx(expected, abs=1e-9)


def test_one_sample_moves_the_weights_along_the_gradient_by_the_stated_step():
    stand = Stand(Fnn, learning_rate=2.0, plant_jacobian=5.5e-4, error_scale=11000.0)
    stand.start()
    e = 0.0012
    assert stand.step(0.001, **see(e))["learning_error"] == e
    x = [math.tanh(200.0 * e), 0.0]
    strengths = firing_strengths(*(normalised_grades(v, CENTRES, [0.24] * 7) for v in x))
    expected = [w - 12.1 * e * a for w, a in zip(initial_weights(), strengths, strict=True)]
    assert stand.unit.weights == pytest.approx(expected, abs=1e-15)


def test_learning_does_not_depend_on_how_a_constant_error_is_sampled():
    once, often = Stand(Fnn), Stand(Fnn)
    once.start(), often.start()
    once.step(0.005, **see(0.001))
    for _ in range(5):
        often.step(0.001, **see(0.001))
    assert once.unit.weights == pytest.approx(often.unit.weights, abs=1e-14)
    assert once.unit.weights != initial_weights()


def test_frozen_weights_do_not_move():
    stand = Stand(Fnn, learning=False)
    first = stand.start(**see(0.001))
    assert stand.step(0.001, **see(0.001)) == first
    assert first["weight_change"] == first["learning_error"] == 0.0


@pytest.mark.parametrize("limit", ["learning_limit", "moment_limit"])
def test_learning_pauses_where_the_moment_or_the_torques_saturate(limit):
    stand = Stand(Fnn, **{limit: 1000.0})
    stand.start()
    large = stand.step(0.001, **see(0.004))
    assert abs(large["yaw_moment"]) >= 1000.0
    assert large["learning_error"] == large["weight_change"] == 0.0
    assert stand.step(0.001, **see(0.0002))["weight_change"] > 0.0


def test_weights_stay_within_their_limit():
    stand = Stand(Fnn, moment_limit=1e6, learning_limit=1e6)
    stand.start()
    for _ in range(3000):
        stand.step(0.001, **see(0.01))
    assert min(stand.unit.weights) == -1.5
    assert max(map(abs, stand.unit.weights)) <= 1.5


def test_recall_brings_weights_back_that_no_longer_serve():
    def change_after(**parameters):
        stand = Stand(Fnn, moment_limit=1e6, learning_limit=1e6, **parameters)
        stand.start()
        for _ in range(300):
            stand.step(0.001, **see(0.001))
        for _ in range(3000):  # rules of the other side fire; those of this side rest
            stand.step(0.001, **see(-0.003))
        return stand.unit.weights[7 * 4 + 3] - initial_weights()[7 * 4 + 3]  # PS, ZO

    kept = change_after()
    recalled = change_after(recall=0.1)
    assert kept < -0.1
    assert 0.0 <= -recalled < 0.02 * -kept


def test_sets_learn_only_when_asked_and_stay_usable():
    still, moving = Stand(Fnn), Stand(Fnn, set_learning_rate=20.0)
    still.start(), moving.start()
    for k in range(2000):
        inputs = see(0.002 * math.sin(0.03 * k), 0.01)
        still.step(0.001, **inputs)
        moving.step(0.001, **inputs)
    assert still.unit.centres == [list(CENTRES)] * 2
    assert moving.unit.centres != still.unit.centres
    assert all(-1.0 <= c <= 1.0 for row in moving.unit.centres for c in row)
    assert all(fnn.NARROWEST <= s <= 1.0 for row in moving.unit.widths for s in row)


def test_one_step_of_learning_sets_goes_down_the_gradient():
    stand = Stand(Fnn, set_learning_rate=2.0)
    stand.start()
    e, rate = 0.0012, 0.004
    stand.step(0.001, **see(e, rate))
    x = [math.tanh(200.0 * e), math.tanh(25.0 * rate)]
    by_centre, by_width = set_gradients(x, initial_weights(), [CENTRES] * 2, [[0.24] * 7] * 2)
    expected = np.array([CENTRES] * 2) - 12.1 * e * np.array(by_centre)
    assert np.max(np.abs(np.clip(expected, -1.0, 1.0) - stand.unit.centres)) < 1e-15
    assert np.max(np.abs(0.24 - 12.1 * e * np.array(by_width) - stand.unit.widths)) < 1e-15


def test_a_new_start_forgets_what_was_learnt():
    stand = Stand(Fnn, set_learning_rate=2.0)
    first = stand.start(**see(0.001))
    for _ in range(10):
        stand.step(0.001, **see(0.001, 0.01))
    fresh = Stand(Fnn, set_learning_rate=2.0)
    stand.unit.start(0.0, list(see(0.001).values()))
    assert fresh.start(**see(0.001)) == first
    assert (stand.unit.weights, stand.unit.centres) == (fresh.unit.weights, fresh.unit.centres)
