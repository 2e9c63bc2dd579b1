"""The notebooks run from the first cell to the last, each in a working folder of its own."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

import pytest

import yawbench as yb
from tests.checkout import ROOT
from tests.reports.made_up import unpacked

FOLDER = ROOT / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
FIRST = "first_steps"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_is_kept_with_the_outputs_of_its_cells(file):
    text = file.read_text(encoding="utf-8")
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == [*range(1, len(cells) + 1)]
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert len([one for one in outputs if "image/png" in one.get("data", {})]) == pictures(cells)
    assert not [one for one in outputs if one["output_type"] == "error" or one.get("name") == "stderr"]
    assert str(Path.home()) not in text and str(ROOT) not in text
    assert len(text) < 200_000  # all together stay below 1 MB


def pictures(cells) -> int:
    """Return how many pictures cells draw."""
    source = "".join("".join(cell["source"]) for cell in cells)
    return len(re.findall(r'subplots\(|\.plot\("', source))


@pytest.mark.parametrize(
    "file",
    [pytest.param(f, id=f.stem, marks=[pytest.mark.exhaustive] * (f.stem != FIRST)) for f in NOTEBOOKS],
)
def test_a_notebook_runs_to_its_end_and_shows_what_it_draws(file, tmp_path, monkeypatch):
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(file, as_version=4)
    NotebookClient(notebook, timeout=600, kernel_name="python3").execute(cwd=str(tmp_path))
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    drawn = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(drawn) == pictures(notebook.cells)
    assert not [output for output in outputs if output.get("name") == "stderr"]


@pytest.mark.exhaustive
def test_what_the_sliders_say_is_what_is_run():
    names = runpy.run_path(str(FOLDER / "sliders.py"))
    outputs, names = names["app"].run()
    runs = names["runs"]
    assert runs["no control"].metric("peak(sideslip)") > 2 * runs["controller_fnn"].metric("peak(sideslip)")
    assert runs["no control"]["plant.velocity_x"][0] == names["speed"].value
    view = outputs[-1]
    assert view.labels == tuple(runs)
    page = unpacked(view.html)
    assert all(name in page for name in ("sideslip", "yaw_rate"))


def test_every_controller_that_the_sliders_offer_can_be_connected():
    offered = re.findall(r'"(controller_\w+)"', Path(FOLDER / "sliders.py").read_text(encoding="utf-8"))
    base = yb.load("fnn_sideslip/25mps")
    assert len(set(offered)) >= 4
    for name in set(offered):
        assert base.swap(controller=name).plan().instances
