"""Panels as images of their own: what they show, and that they are sound addresses."""

from __future__ import annotations

from urllib.parse import unquote

import pytest
from lxml import etree

from orchestrator.figures.panels import LabelledRun
from orchestrator.pages.page_parts import address_of, in_html, panel_images
from tests.orchestrator.recorded import car

RUNS = [LabelledRun("off <b>", car(2.4)), LabelledRun("fuzzy & neural", car(1.02, chatter=300.0))]


def svg_of(image) -> etree._Element:
    """Return the image behind an address, which must be well-formed."""
    assert '"' not in image.address and "#" not in image.address and "<" not in image.address
    return etree.fromstring(unquote(image.address.partition(",")[2]).encode())


def test_there_is_an_image_for_every_panel_that_the_runs_have_signals_for():
    images, _ = panel_images(RUNS, ["steer_angle", "sideslip_error", "roll_angle", "wheel_torque_*", "path"])
    names = [
        "steer_angle",
        "sideslip_error",
        *(f"wheel_torque_{w}" for w in ("fl", "fr", "rl", "rr")),
        "path",
    ]
    assert [image.name for image in images] == names
    for image in images:
        lines = [path for path in svg_of(image).iter("{*}path") if "fill: none" in path.get("style", "")]
        assert len(lines) >= 2


def test_the_title_is_text_of_the_page_with_its_formula():
    images, _ = panel_images(RUNS, ["sideslip_error", "steer_angle"])
    assert images[0].heading == "Sideslip angle, error in % of max|<i>β<sub>ref</sub></i>|"
    said = "".join(svg_of(images[1]).itertext())
    assert "Steer angle" not in said and "t" in said


def test_text_that_looks_like_html_is_escaped():
    assert in_html("<b>$β$") == "&lt;b&gt;<i>β</i>"


def test_the_legend_has_an_entry_for_every_run_and_one_for_the_reference():
    _, legend = panel_images(RUNS, ["sideslip"])
    assert [entry.label for entry in legend] == ["off <b>", "fuzzy & neural", "reference"]
    assert legend[0].colour != legend[1].colour and legend[0].dashes != legend[1].dashes
    assert panel_images(RUNS[:1], ["yaw_moment"])[1] == []


def test_panels_of_one_scale_keep_the_same_limits():
    images, _ = panel_images(RUNS, ["wheel_torque_*"])
    ticks = [[e.text for e in svg_of(image).iter("{*}text")] for image in images]
    assert ticks[0] == ticks[1] == ticks[2] == ticks[3]


def test_a_panel_stays_small_even_if_its_signal_chatters():
    (image,), _ = panel_images([LabelledRun("long", car(n=80_001, chatter=500.0))], ["yaw_moment"])
    assert len(image.address) < 60_000


@pytest.mark.parametrize("text", ["it's", 'say "so"', "100 % & more", "a #1"])
def test_any_text_survives_the_address(text):
    svg = etree.Element("svg", xmlns="http://www.w3.org/2000/svg")
    etree.SubElement(svg, "text").text = text
    address = address_of(etree.tostring(svg, encoding="unicode"))
    shown = "".join(etree.fromstring(unquote(address.partition(",")[2])).itertext())
    assert shown.replace("’", "'").replace("”", '"') == text
