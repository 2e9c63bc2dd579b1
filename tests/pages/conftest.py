"""Fixtures of the pages' tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from . import browser as browsers


@pytest.fixture(scope="module")
def chromium() -> Iterator[browsers.Browser]:
    """A browser, one for all tests of a file."""
    browser = browsers.start()
    try:
        yield browser
    finally:
        browser.driver.quit()
