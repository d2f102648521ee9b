"""What a long job tells while it runs: how far it is, and how long each stage took."""

from __future__ import annotations

import time
from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called with (done, total, what)."""


class Clock:
    """Seconds per stage, for the record (never part of a program), and progress passed on."""

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self.stages: dict[str, float] = {}
        self._start = self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self.stages[stage] = self.stages.get(stage, 0.0) + now - self._last
        self._last = now

    def step(self, done: int, total: int, what: str) -> None:
        """Pass progress on."""
        if self._progress is not None:
            self._progress(done, total, what)

    def total(self) -> dict[str, float]:
        """Return the seconds of all stages and their ``total``."""
        return {**self.stages, "total": time.perf_counter() - self._start}
