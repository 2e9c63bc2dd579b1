"""The samples that a page carries, decoded without a browser."""

from __future__ import annotations

import base64
import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np

from tests.reports.made_up import data_in


class Samples:
    """The samples of all runs of a page's only viewer, and its data."""

    def __init__(self, page: Path) -> None:
        html = page.read_text(encoding="utf-8")
        self.data: dict[str, Any] = data_in(html)
        self.blocks = re.findall(r'<script type="text/plain">(.*?)</script>', html)

    def of(self, run: int, name: str) -> tuple[np.ndarray, float]:
        """Return a column, or "time", of a run, and its step."""
        header = self.data["runs"][run]
        offset, base, step = header["time"] if name == "time" else header["columns"][name]
        block = gzip.decompress(base64.b64decode(self.blocks[run]))
        lowest_first = np.frombuffer(block, np.uint8, 4 * header["rows"], int(offset)).reshape(4, -1)
        zigzag = np.ascontiguousarray(lowest_first.T).view("<u4")[:, 0].astype(np.int64)
        codes = np.cumsum(np.cumsum((zigzag >> 1) ^ -(zigzag & 1), dtype=np.int32), dtype=np.int32)
        return base + codes * step, step
