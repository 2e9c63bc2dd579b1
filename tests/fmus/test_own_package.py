"""A component from anywhere takes along the modules of its own folder or package, and no others."""

from __future__ import annotations

import sys

import pytest

from tests.fmus.test_build_errors import GOOD
from tests.refusals import refused
from yawbench.fmus.build import build_component, recipe_of
from yawbench.fmus.staging import staged
from yawbench.foundation.errors import BuildError

PACKAGE = {
    "__init__": "import numpy\n\nSHARE = 0.5\n",
    "controllers/__init__": "import numpy\n",
    "controllers/gains": "import mylab.units as u\n\nfrom ..limits import LIMIT\n\nFACTOR = LIMIT * u.ONE\n",
    "limits": "import mylab.units\n\nLIMIT = 4.0 * mylab.units.ONE\n",
    "units": "ONE = 1.0\n",
}
IMPORTS = {
    "relative": "from .gains import (\n    FACTOR,  # of all\n)\n",
    "absolute": "from mylab.controllers.gains import FACTOR\n",
    "a module": "from . import gains; FACTOR = gains.FACTOR\n",
    "from above": "from .. import limits\nFACTOR = limits.LIMIT\n",
    "plain": "import math, mylab.limits; FACTOR = math.sqrt(mylab.limits.LIMIT**2)\n",
    "with another name": "import mylab.limits as within\nFACTOR = within.LIMIT\n",
    "within a function": "def f():\n    from mylab.limits import LIMIT as x\n    return x\nFACTOR = f()\n",
    "the library": "import yawbench as yb\nfrom yawbench import signal\nFACTOR = 4 * (yb.signal is signal)\n",
}
FORBIDDEN = {
    "a package that needs numpy": ("from mylab import SHARE\n", "mylab/__init__.py:1", "numpy"),
    "a module that does not exist": ("from .gain import FACTOR\n", "controllers/idea.py:7", "gain"),
    "a name of the package": ("from mylab.limit import FACTOR\n", "controllers/idea.py:7", "mylab.limit"),
    "the folder above": ("from ... import FACTOR\n", "controllers/idea.py:7", "relative"),
    "another package": ("import numpy, mylab.limits\n", "controllers/idea.py:7", "numpy"),
    "a module beside, not by a relative name": (
        "import gains\n",
        "controllers/idea.py:7",
        "gains.py",
        "'from . import gains'",
    ),
}


def component(imports: str) -> str:
    text = GOOD.replace(
        "from yawbench.components.fmi.component", f"{imports}from yawbench.components.fmi.component"
    )
    return text.replace("-self.p.gain", "-FACTOR * self.p.gain")


@pytest.fixture
def mylab(tmp_path):
    """Write a package with a controller that has these imports, and return the controller's file."""

    def write(imports, *, markers=True):
        folder = tmp_path / "src" / "mylab"
        for name, text in (PACKAGE | {"controllers/idea": component(imports)}).items():
            if markers or not name.endswith("__init__"):
                (folder / f"{name}.py").parent.mkdir(parents=True, exist_ok=True)
                (folder / f"{name}.py").write_text(text)
        return folder / "controllers" / "idea.py"

    return write


@pytest.mark.parametrize("imports", IMPORTS)
def test_imports_of_the_own_package_are_resolved_within_the_fmu(mylab, imports):
    recipe = recipe_of(mylab(IMPORTS[imports]))
    files = recipe.sources.closure(recipe.module)
    assert ("own/mylab/units.py" in files) == (imports != "the library")
    assert not any("import numpy" in text for text in files.values())
    with staged(files, "packed") as stage:
        stage.component(recipe.module)
        assert sys.modules["packed.controllers.idea"].FACTOR == 4.0
        assert "mylab" not in sys.modules


@pytest.mark.parametrize("imports", ["absolute", "plain"])
def test_a_package_needs_no_init_file(mylab, imports):
    recipe = recipe_of(mylab(IMPORTS[imports], markers=False))
    gains = recipe.source.with_name("gains.py")
    gains.write_text(gains.read_text().replace("from ..limits", "from mylab.limits"))
    with staged(recipe.sources.closure(recipe.module), "packed") as stage:
        stage.component(recipe.module)
        assert sys.modules["packed.controllers.idea"].FACTOR == 4.0


def test_modules_beside_the_file_are_found_by_either_kind_of_name(tmp_path):
    (tmp_path / "gains.py").write_text("from helpers import one\n\nFACTOR = 4.0 * one()\n")
    (tmp_path / "helpers.py").write_text("def one():\n    return 1.0\n")
    file = tmp_path / "controller_idea.py"
    for imports in (
        "from gains import FACTOR\n",
        "from .gains import FACTOR\n",
        "from . import gains; FACTOR = gains.FACTOR\n",
    ):
        file.write_text(component(imports))
        recipe = recipe_of(file)
        files = recipe.sources.closure(recipe.module)
        assert {"own/gains.py", "own/helpers.py"} < set(files)
        with staged(files, "packed") as stage:
            stage.component(recipe.module)
            assert sys.modules["packed.controllers.controller_idea"].FACTOR == 4.0


@pytest.mark.parametrize("imports", FORBIDDEN)
def test_what_cannot_be_packed_is_named_with_file_and_line(mylab, tmp_path, imports):
    source, *names = FORBIDDEN[imports]
    with refused(BuildError, "component-import-forbidden", names=("controller_idea", *names)):
        build_component(mylab(source), tmp_path / "out")
    assert not list(tmp_path.glob("out/*"))
