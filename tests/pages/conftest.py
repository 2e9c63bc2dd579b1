"""Fixtures of the pages' tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from . import browser as browsers


@pytest.fixture(scope="session")
def window() -> Iterator[browsers.Browser]:
    """A browser, one for all tests of a worker."""
    browser = browsers.start()
    try:
        yield browser
    finally:
        browser.driver.quit()


@pytest.fixture(scope="module")
def chromium(window: browsers.Browser) -> Iterator[browsers.Browser]:
    """The browser, left without a page and without messages on its console at the end of a file."""
    yield window
    window.driver.get("about:blank")
    window.console()
