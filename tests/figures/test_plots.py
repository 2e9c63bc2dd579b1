"""Figures: panels, lines, words, units, scales and files."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from tests.orchestrator.recorded import car, noted, results
from tests.refusals import each_mentions, mentions, refused
from yawbench.figures.panels import LabelledRun, check_panels, thinned
from yawbench.figures.plots import draw, minus, provenance, title_of
from yawbench.figures.style import LINES, literal, save
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.orchestrator.plan import Override


def panel(figure, name):
    return next(axes for axes in figure.axes if axes.get_label() == name)


def names(figure):
    return [axes.get_label() for axes in figure.axes]


def legend(figure):
    return [text.get_text() for box in figure.legends for text in box.get_texts()]


SEVERAL = [
    LabelledRun("no control", car(2.4)),
    LabelledRun("fuzzy", car(1.2)),
    LabelledRun("neural", car(1.02)),
]


def test_the_overview_of_a_car_has_the_papers_panels_in_order():
    figure = draw([LabelledRun("run", car())])
    assert names(figure) == [
        "steer_angle", "sideslip", "yaw_rate", "acceleration_y", "yaw_moment", "wheel_torque_*", "path",
    ]  # fmt: skip


def test_a_panel_without_its_signal_is_left_out():
    t = np.linspace(0, 1, 11)
    figure = draw([LabelledRun("run", results({"plant.yaw_rate": t, "plant.position_x": t}, t))])
    assert names(figure) == ["yaw_rate"]


def test_a_run_with_none_of_the_signals_is_an_error():
    with refused(ResultsError, "nothing-to-draw", names=("made_up/results.csv", "steer_angle", "yaw_rate")):
        draw([LabelledRun("run", results({"plant.other": [0.0, 1.0]}))])


def test_angles_are_drawn_in_degrees_and_named_so():
    run = car()
    axes = panel(draw([LabelledRun("run", run)], ["steer_angle"]), "steer_angle")
    assert mentions(axes.get_title(loc="left"), "Steer", "angle")
    assert np.max(axes.get_lines()[0].get_ydata()) == pytest.approx(np.degrees(0.03), rel=1e-3)


def test_a_signal_with_a_reference_is_drawn_over_it():
    lines = panel(draw([LabelledRun("run", car(1.5))], ["sideslip"]), "sideslip").get_lines()
    assert [line.get_label() == "reference" for line in lines] == [True, False]
    assert lines[0].get_zorder() <= lines[1].get_zorder()
    assert lines[0].get_linewidth() > 2 * lines[1].get_linewidth()


def test_runs_with_one_reference_share_its_line():
    figure = draw(SEVERAL, ["sideslip"])
    assert len(panel(figure, "sideslip").get_lines()) == 4
    assert legend(figure) == ["no control", "fuzzy", "neural", "reference"]


def test_runs_with_references_of_their_own_show_each_in_the_runs_colour():
    slow = car(1.0)
    slow.columns["reference.sideslip_ref"] = 1.5 * slow.columns["reference.sideslip_ref"]
    figure = draw([SEVERAL[1], LabelledRun("slow", slow)], ["sideslip"])
    pale = [line for line in panel(figure, "sideslip").get_lines() if line.get_label() == "reference"]
    assert [line.get_color() for line in pale] == [LINES[0]["color"], LINES[1]["color"]]
    assert mentions(legend(figure)[-1], "wide", "reference")


def test_a_difference_is_of_each_other_run_without_references_also_at_equal_speeds():
    _, fuzzy, neural = SEVERAL
    apart = minus(SEVERAL, fuzzy)
    figure = draw(apart, ["sideslip"])
    assert legend(figure) == ["no control minus fuzzy", "neural minus fuzzy"]
    _, line = panel(figure, "sideslip").get_lines()
    wanted = neural.results["plant.sideslip"] - fuzzy.results["plant.sideslip"]
    assert np.asarray(line.get_ydata()) == pytest.approx(np.degrees(wanted), nan_ok=True)
    assert np.isfinite(line.get_ydata()).all()


def test_an_angle_that_passes_half_a_turn_is_not_joined_across_the_panel():
    t = np.linspace(0.0, 4.0, 401)
    angle = np.angle(np.exp(1j * np.pi * 0.6 * t))  # beyond half a turn at 1.67 s
    (line,) = panel(
        draw([LabelledRun("run", results({"plant.sideslip": angle}, t))], ["sideslip"]), "sideslip"
    ).lines
    drawn = line.get_ydata()
    assert np.isnan(drawn).sum() == 1
    assert np.nanmax(np.abs(np.diff(drawn))) < 2.0


def test_wheels_of_one_run_share_a_panel_with_a_legend():
    axes = panel(draw([LabelledRun("run", car())], ["wheel_torque_*"]), "wheel_torque_*")
    assert len(axes.get_lines()) == 4
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["fl", "fr", "rl", "rr"]


def test_wheels_of_several_runs_have_a_panel_each():
    figure = draw(SEVERAL, ["wheel_torque_*"])
    assert names(figure) == [f"wheel_torque_{w}" for w in ("fl", "fr", "rl", "rr")]
    assert all(len(axes.get_lines()) == 3 for axes in figure.axes)
    assert mentions(panel(figure, "wheel_torque_rr").get_title(loc="left"), "torque", "rear", "right")


def test_the_error_panel_is_in_per_cent_of_the_references_peak():
    axes = panel(draw([LabelledRun("run", car(1.5))], ["sideslip_error"]), "sideslip_error")
    assert np.max(axes.get_lines()[0].get_ydata()) == pytest.approx(50.0, rel=1e-3)


def test_a_lost_car_leaves_the_axes_and_the_figure_says_so():
    figure = draw([LabelledRun("lost", car(40.0)), LabelledRun("held", car(1.1))], ["sideslip"])
    axes = panel(figure, "sideslip")
    assert axes.get_ylim()[1] < 3 * np.degrees(1.1 * 0.6 * 0.03)
    assert each_mentions([text.get_text() for text in axes.texts], ("41.3\N{NO-BREAK SPACE}°", "lost"))


@pytest.mark.parametrize("runs", [(40.0,), (24.0, 6.0)])
def test_a_lost_car_stays_in_the_axes_alone_or_with_another_beyond_a_tiny_reference(runs):
    axes = panel(draw([LabelledRun(str(gain), car(gain)) for gain in runs], ["sideslip"]), "sideslip")
    assert axes.get_ylim()[1] > np.degrees(runs[0] * 0.6 * 0.03)
    assert not axes.texts


def path_of(length, breadth):
    x, y = np.linspace(0, length, 101), breadth * np.sin(np.linspace(0, np.pi, 101))
    return draw([LabelledRun("run", results({"plant.position_x": x, "plant.position_y": y}))], ["path"])


def test_a_broad_path_is_drawn_to_scale():
    axes = panel(path_of(60.0, 40.0), "path")
    assert axes.get_aspect() == 1.0
    assert mentions(axes.get_title(loc="left"), "axes", "scale")


def test_a_narrow_path_is_stretched_and_the_figure_says_how_much():
    figure = path_of(200.0, 3.0)
    axes = panel(figure, "path")
    assert axes.get_aspect() == 5.0
    assert mentions(axes.get_title(loc="left"), "5", "lateral", "longitudinal")
    figure.draw_without_rendering()
    low, high = axes.get_ylim()
    assert 3.0 < high - low < 12.0


def test_title_and_provenance_come_from_the_runs_records():
    figure = draw(SEVERAL, ["yaw_rate"])
    texts = [text.get_text() for text in figure.texts]
    assert texts[0] == title_of(SEVERAL) == "Sine at 25 m/s"
    assert texts[1].replace("\n", " ") == provenance(SEVERAL)
    assert mentions(provenance(SEVERAL), "1.00 ms", "controller_made_up", "01234567", "plant_made_up")


def test_a_run_that_failed_is_named():
    failed = car()
    failed.record.status = "failed"
    assert "third try" in provenance([LabelledRun("third try", failed)])


def test_a_thinned_line_keeps_its_peaks_and_its_ends():
    t = np.linspace(0, 1, 100_001)
    x = np.sin(9 * t)
    x[54_321] = 7.0
    thin_t, thin_x = thinned(t, x)
    assert thin_x.size <= 3002
    assert thin_x.max() == 7.0
    assert (thin_t[0], thin_t[-1]) == (0.0, 1.0)
    assert np.all(np.diff(thin_t) > 0)


def test_a_figure_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with refused(ResultsError, "results-unwritable", names=("overview", "figure", "directory")):
        save(path_of(60.0, 40.0), tmp_path / "file" / "figures" / "overview")


def test_a_portrait_shows_one_signal_over_the_other_with_references_and_ends():
    run = car(0.9)
    figure = draw([LabelledRun("a", run)], ["yaw_rate(sideslip)"])
    (axes,) = figure.axes
    reference, curve, end = axes.get_lines()
    degrees = 180 / np.pi
    assert np.allclose(curve.get_xdata(), degrees * run["plant.sideslip"])
    assert np.allclose(curve.get_ydata(), degrees * run["plant.yaw_rate"])
    assert np.allclose(reference.get_xdata(), degrees * run["reference.sideslip_ref"])
    assert end.get_xdata()[0] == pytest.approx(degrees * run["plant.sideslip"][-1])
    assert axes.get_xlabel() == "$β$ in °"
    assert axes.get_ylabel() == "$r$ in °/s"


def test_a_panel_that_no_run_has_is_refused_with_the_likely_one() -> None:
    runs = [LabelledRun("a", car())]
    check_panels(runs, ["sideslip", "sideslip_error", "yaw_rate(sideslip)"])
    with pytest.raises(ScenarioError) as caught:
        check_panels(runs, ["sidslip", "sideslip_eror", "sideslip", "yaw_rate(roll_angle)"])
    wrong = ("--panel sidslip", "'sideslip'"), ("--panel sideslip_eror", "'sideslip_error'")
    assert each_mentions(caught.value.diagnostics, *wrong, ("--panel yaw_rate(roll_angle)",))


@pytest.mark.parametrize("rows", [0, 1])
def test_a_run_that_ended_at_its_start_is_one_sentence(rows):
    ended = results({name: np.zeros(rows) for name in ("plant.yaw_rate", "plant.sideslip")}, np.zeros(rows))
    noted(ended, status="failed", error={"message": "plant: initialization failed"})
    with refused(ResultsError, names=("made_up", "draw", "start")):
        draw([LabelledRun("good", car()), LabelledRun("ended", ended)])


def test_a_figure_is_valid_svg_whatever_characters_labels_have(tmp_path):
    labels = ["\x1b[31mred", "a\x00b", "\u202eturned", "\ufffe\uffff", "\ud800", "<&>\"'", "$a_{$", r"$\b$"]
    runs, title = [LabelledRun(label, car(1.2)) for label in labels], " ".join(labels)
    noted(runs[0].results, changes=[Override.of("driver.name", "$x_{", "--set").record])
    panels = {"plot": "yaw_rate", "portrait": "yaw_rate(sideslip)"}
    figures = {name: draw(runs, [panel], title=title) for name, panel in panels.items()}
    for name, figure in figures.items():
        svg, png = save(figure, tmp_path / name)
        root = ElementTree.parse(svg).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert png.stat().st_size
        assert {*map(literal, labels)} <= {*legend(figure)}
