"""A copy of the checkout to try things in: its sources and built FMUs, and the environment of the tests."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CODE = ("components", "vocabulary", "foundation", "fmus", "orchestrator", "scenarios", "yawbench")
PARTS = (*CODE, "docs", "tests", "campaigns")
FILES = ("README.md", "CHANGELOG.md", "LICENSE", "Makefile", "mkdocs.yml", "pyproject.toml")


def copy_checkout(folder: Path, parts: tuple[str, ...] = PARTS) -> Path:
    """Copy parts of the checkout, with the environment in use as `.venv`, and return the folder.

    Modules that are compiled stay so, which saves every command in the copy from compiling them.
    """
    forgotten = shutil.ignore_patterns(".*")
    for part in parts:
        shutil.copytree(ROOT / part, folder / part, ignore=forgotten, symlinks=True)
    for file in FILES:
        if (ROOT / file).exists():
            shutil.copy(ROOT / file, folder / file)
    (folder / ".venv").symlink_to(sys.prefix, target_is_directory=True)
    return folder


def run_in(folder: Path, *command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, with the sources of the checkout that it belongs to, if it is one.

    `yawbench` and `python` are those of the environment in use.
    """
    named = {"yawbench": [sys.executable, "-m", "yawbench"], "python": [sys.executable]}
    first, *others = map(str, command)
    sources = folder if (folder / "orchestrator").is_dir() else ROOT
    return subprocess.run(
        [*named.get(Path(first).name, [first]), *others],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(sources), "PYTHONDONTWRITEBYTECODE": "1"} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def install_apart(wheel: Path, environment: Path) -> Path:
    """Install a wheel in an environment of its own, with the dependencies of the one in use; return it."""
    made = run_apart(sys.executable, "-m", "venv", "--without-pip", environment, cwd=wheel.parent)
    (packages,) = environment.glob("lib/python*/site-packages")
    (packages / "shared.pth").write_text("\n".join(p for p in sys.path if p.endswith("site-packages")))
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", environment / "bin/python")
    done = run_apart(*pip, "install", "--quiet", "--no-deps", "--no-index", wheel, cwd=wheel.parent)
    assert made.returncode == done.returncode == 0, made.stderr + done.stderr
    return environment


def run_apart(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command without a checkout on Python's path."""
    plain = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        command, cwd=cwd, env=plain | environment, capture_output=True, text=True, check=False
    )
