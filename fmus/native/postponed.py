"""Native libraries that take too long for a run to wait for; `yawbench build` makes them."""

from __future__ import annotations

import hashlib

from yawbench.foundation.cache import keep, recall

LONGEST = 3.0
"""Processor time [s] above which a run does not wait for a native library; chosen: runs start within 3 s."""
MOST_TEXT = 200_000
"""Largest number of characters in C of a component that a run waits for if it was never built; chosen: those
of this project's that have more take longer than `LONGEST`."""
LATER = "its native library takes longer than a run should wait; 'yawbench build' makes it"
EFFORTS = "efforts"
"""Folder of the processor times of builds of native libraries, in the cache."""


class Effort:
    """What the last build of a component's native library cost, as kept in the cache."""

    def __init__(self, component: str) -> None:
        self._entry = hashlib.sha256(component.encode()).hexdigest()
        self._seconds = recall(EFFORTS, self._entry)

    @property
    def takes_long(self) -> bool:
        """Whether the last build took longer than `LONGEST`."""
        return float(self._seconds or 0.0) > LONGEST

    def will_take_long(self, text: str) -> bool:
        """Return whether the build of a text in C will take long, where it is the first."""
        return self._seconds is None and len(text) > MOST_TEXT

    def note(self, seconds: float) -> None:
        """Keep what a build has cost [s of processor time]."""
        keep(EFFORTS, self._entry, str(seconds).encode())
