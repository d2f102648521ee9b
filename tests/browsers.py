"""A real browser for tests of pages, skipped where none is installed."""

from contextlib import contextmanager

import pytest

from tools.dev.browser import Browser, installed


@contextmanager
def chromium():
    command = installed()
    if command is None:
        pytest.skip("no Chromium is installed")
    started = Browser(command)
    yield started
    started.close()
