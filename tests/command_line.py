"""The command line, called in the process of the tests."""

from __future__ import annotations

import pytest

from yawbench.cli import main


def status_of(*arguments: object) -> int:
    """Return the exit status of `yawbench` with these arguments."""
    with pytest.raises(SystemExit) as ended:
        main([str(one) for one in arguments])
    code = ended.value.code or 0
    assert isinstance(code, int)
    return code
