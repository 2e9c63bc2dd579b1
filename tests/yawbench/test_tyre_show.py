"""A tyre on a stand of its own, and the figure of it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.command_line import status_of
from tests.components.stand import Stand as Bench
from tests.refusals import each_mentions, mentions
from tests.vehicles.tir_files import write
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.tyre_stand import WheelState, draw_tyre, put_on_stand, stiffnesses
from yawbench.vehicles.tir import read_tir

UNITS = ("tyre_magic_formula_62", "tyre_magic_formula_62_transient", "tyre_dugoff", "controller_off")
STATES = [
    WheelState(0.05, 0.02, 3000.0),
    WheelState(-0.1, -0.3, 5000.0),
    WheelState(0.2, 0.4, 6000.0),
    WheelState(0.0, 0.0, 4000.0),
]


def stand_of(source, fmus, friction=0.8):
    return put_on_stand(str(source), friction=friction, fmus=fmus, build=False)


def test_a_stand_gives_what_the_tyre_gives_in_steady_motion(tmp_path, fmus):
    path = write(tmp_path / "a.tir")
    found = stand_of(path, fmus).measure(STATES)
    given = {
        f"{name}_{axle}": value for name, value in read_tir(path).values.items() for axle in ("front", "rear")
    }
    known = {v.name for v in MagicFormula62.variables}
    bench = Bench(MagicFormula62, **{name: value for name, value in given.items() if name in known})
    bench.start()
    for i, state in enumerate(STATES):
        y = bench.step(
            1.0,
            slip_angle_fl=state.alpha,
            slip_ratio_fl=state.kappa,
            vertical_load_fl=state.load,
            friction_fl=0.8,
        )
        for name in ("tyre_force_x", "tyre_force_y", "aligning_moment"):
            assert found[name][i] == pytest.approx(y[f"{name}_fl"], rel=1e-9, abs=1e-6), (name, i)
    assert found["relaxation_length_y"][3] == pytest.approx(0.45, abs=0.03)


def test_stiffnesses_are_the_slopes_at_zero_slip(fmus):
    k_x, k_y = stiffnesses(stand_of("tyre_dugoff", fmus), [2000.0, 4000.0])
    assert k_x == pytest.approx([40000.0, 40000.0], rel=1e-4)
    assert k_y == pytest.approx([50000.0, 50000.0], rel=1e-4)


def test_the_figure_shows_all_that_the_tyre_tells(tmp_path, fmus):
    whole = draw_tyre(stand_of(write(tmp_path / "a.tir"), fmus), "title", "note")
    assert [len(axes.get_lines()) for axes in whole.axes] == [8, 4, 4, 5, 2, 2]  # four of the legend
    lateral = whole.axes[0].get_lines()
    assert [line.get_label() for line in lateral[:4]] == [
        "F_z = 2 kN",
        "F_z = 4 kN",
        "F_z = 6 kN",
        "F_z = 8 kN",
    ]
    peaks = [np.max(np.abs(line.get_ydata())) for line in lateral[:4]]
    assert peaks == sorted(peaks)
    poor = draw_tyre(stand_of("tyre_dugoff", fmus), "title", "note")
    says = [text.get_text() for axes in poor.axes for text in axes.texts]
    assert each_mentions(says, ("tyre", "moment"), ("tyre", "forces", "lag"))


def test_the_command_writes_one_figure_and_tells_warnings(tmp_path, fmus, capsys):
    path = write(tmp_path / "a.tir", {"TYRESIDE": "UNKNOWN"})
    assert not status_of("tyre", "show", path, "--fmus", fmus, "--out", tmp_path / "shown.png")
    assert {"shown.svg", "shown.png"} <= {file.name for file in tmp_path.iterdir()}
    assert mentions(capsys.readouterr().err, "TYRESIDE", "UNKNOWN", "LEFT")


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("none.tir", ("none.tir", "tyre", "property")),
        ("tyre_brush", ("tyre_brush",)),
        ("controller_off", ("controller_off", "tyre_force_x_fl")),
    ],
)
def test_what_is_no_tyre_is_refused_in_a_sentence(tmp_path, fmus, capsys, monkeypatch, source, names):
    monkeypatch.chdir(tmp_path)
    assert status_of("tyre", "show", source, "--fmus", fmus) == 2
    assert mentions(capsys.readouterr().err, *names)
