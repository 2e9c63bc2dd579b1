"""Every name of the library shows a use of itself, which is so."""

from __future__ import annotations

import doctest
import re
import shutil
import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

import yawbench as yb
import yawbench.components.fmi.variables

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def examples(name: str) -> list[doctest.DocTest]:
    """Return the examples of a public name, those of its methods too."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    return [found for found in finder.find(getattr(yb, name), name, module=False) if found.examples]


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """The names that examples use: the library, a scenario, its run, saved in the working folder.

    The scenario is cut short: those who use it tell of its beginning alone.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("examples"))
        whole = yb.load("fnn_sideslip/25mps")
        run = whole.run()
        text = whole.path.read_text(encoding="utf-8")
        assert "stop_time: 8.0" in text
        for folder in ("fnn_sideslip", "vehicles"):
            shutil.copytree(whole.path.parents[1] / folder, folder)
        Path("fnn_sideslip/short.yaml").write_text(text.replace("stop_time: 8.0", "stop_time: 2.5"))
        base = yb.load("fnn_sideslip/short.yaml")
        run.save("results/mine")
        yield {"yb": yb, "base": base, "run": run, **vars(yawbench.components.fmi.variables)}


@pytest.mark.parametrize("name", yb.__all__)
def test_the_use_that_a_docstring_shows_is_so(name, shown):
    found = examples(name)
    assert found, f"{name} shows no use"
    said: list[str] = []
    for one in found:
        one.globs = dict(shown)
        doctest.DocTestRunner(optionflags=FLAGS).run(one, out=said.append)
    plt.close("all")
    assert not said, "".join(said)


def test_the_programs_in_the_docstring_of_the_package_run_and_say_the_truth(shown):
    blocks = re.findall(r"\n\n((?:    .*\n|\n)+)", (yb.__doc__ or "").partition("YawbenchError\n")[0])
    program = textwrap.dedent("".join(blocks))
    names: dict[str, object] = {}
    exec(program, names)
    plt.close("all")
    told = re.search(r"# ([\d.]+) rad", program)
    run = names["run"]
    assert isinstance(run, yb.Run)
    assert told is not None
    assert f"{run.metric('peak(sideslip)'):.4f}" == told[1]
    assert "def " in program
