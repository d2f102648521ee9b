"""How far a batch is: a bar with rate, failures and time left; plain lines in a pipe."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from postproc.cli.common import Session

Tick = Callable[[int, int, int], None]
"""Takes (done, of how many, how many of them failed)."""

EVERY = 30.0
"""Longest time [s] between two lines in a pipe while jobs finish."""


@contextmanager
def ticker(session: Session) -> Iterator[Tick]:
    """Yield what shows the progress of a batch on stderr; nothing with ``--quiet``."""
    if session.quiet:
        yield lambda done, total, failed: None
    elif sys.stderr.isatty():
        with _bar() as bar:
            yield bar
    else:
        yield Lines(session.say)


class Lines:
    """One line for every tenth of the work, and at least every ``EVERY`` seconds.

    Args:
        say: prints a line.
        clock: tells the time [s].
    """

    def __init__(
        self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._say, self._clock = say, clock
        self._start = self._last = clock()
        self._tenths = 0

    def __call__(self, done: int, total: int, failed: int) -> None:
        """Take note of a finished job."""
        now, tenths = self._clock(), 10 * done // total
        if tenths == self._tenths and now - self._last < EVERY:
            return
        self._tenths, self._last = tenths, now
        self._say(f"{done} of {total}, {speed(done, total, now - self._start)}, {failed} failed")


def speed(done: int, total: int, seconds: float) -> str:
    """Return rate and time left in words."""
    if seconds <= 0.0 or not done:
        return "just begun"
    rate = done / seconds
    left = (total - done) / rate
    pace = f"{rate:.1f} per s" if rate >= 1.0 else f"{60.0 * rate:.1f} per min"
    return f"{pace}, {int(left // 3600)}:{int(left // 60) % 60:02d}:{int(left) % 60:02d} left"


@contextmanager
def _bar() -> Iterator[Tick]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns: tuple[Any, ...] = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
    start = time.monotonic()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)

        def report(done: int, total: int, failed: int) -> None:
            words = f"{speed(done, total, time.monotonic() - start)}, {failed} failed"
            bar.update(task, completed=done, total=total, description=words)

        yield report
