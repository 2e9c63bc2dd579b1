"""Outputs of the notebooks, stored in them: `python -m docs.generate.notebooks [NAME...]`.

Each is run in a folder of its own. What only a browser shows (viewers, progress bars) is left out; pictures
have a palette, and the folder of this checkout is `yawbench`.
"""

from __future__ import annotations

import base64
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("image/png", "text/html", "text/plain")
"""Kinds of outputs that are kept."""
LARGEST = 200_000
"""Characters of the largest output that is kept; chosen: above a figure, below a viewer with its runs."""

COLOURS = 64
"""Colours of a picture; chosen: lines and letters look the same."""


def executed(file: Path) -> dict[str, Any]:
    """Return a notebook with the outputs of its cells, as they are stored."""
    import nbformat
    from nbclient import NotebookClient

    os.environ["PYTHONPATH"] = str(ROOT)
    notebook = nbformat.read(file, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=3600, kernel_name="python3").execute(cwd=folder)
    stored: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    for cell, made in zip(stored["cells"], notebook.cells, strict=True):
        if cell["cell_type"] == "code":
            cell["execution_count"] = made.execution_count
            cell["outputs"] = [kept for output in made.outputs if (kept := _kept(dict(output)))]
    return stored


def _kept(output: dict[str, Any]) -> dict[str, Any] | None:
    """Return an output as it is stored; None for one that only a browser shows, or a message on stderr."""
    if output["output_type"] == "stream":
        return {**output, "text": _of_anywhere(output["text"])} if output["name"] == "stdout" else None
    data = {kind: output["data"].get(kind, "") for kind in KINDS}
    if picture := data["image/png"]:
        data["image/png"] = _small(picture)
    data = {kind: _of_anywhere(text) for kind, text in data.items() if 0 < len(text) <= LARGEST}
    return {**output, "data": data, "metadata": {}} if data else None


def _small(picture: str) -> str:
    """Return a picture, PNG in base64, with a palette: a third of its bytes."""
    from PIL import Image

    small = io.BytesIO()
    with Image.open(io.BytesIO(base64.b64decode(picture))) as whole:
        whole.convert("RGB").quantize(COLOURS).save(small, "PNG", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


def _of_anywhere(text: str) -> str:
    return text.replace(str(ROOT), "yawbench")


def main() -> None:
    """Run the named notebooks, by default all, and store their outputs."""
    folder = ROOT / "notebooks"
    for file in [folder / f"{name}.ipynb" for name in sys.argv[1:]] or sorted(folder.glob("*.ipynb")):
        text = json.dumps(executed(file), indent=1, ensure_ascii=False)
        file.write_text(f"{text}\n", encoding="utf-8")
        print(f"{file.name}: {len(text) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
