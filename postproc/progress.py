"""What a long job tells while it runs: how far it is, and how long each stage took."""

from __future__ import annotations

import time
from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called with (done, total, what); a total of 0: nobody knows how much there is to do."""


class Clock:
    """Seconds per stage, for the record (never part of a program), and progress passed on.

    Args:
        stage: the first stage.
        progress: told when a stage begins, and how far it is.
    """

    def __init__(self, stage: str, progress: Progress | None = None) -> None:
        self._progress = progress
        self._stages: dict[str, float] = {}
        self._stage = stage
        self._start = self._last = time.perf_counter()
        self.step(0, 0, stage)

    def begin(self, stage: str) -> None:
        """End the running stage and begin another one."""
        self.stages()
        self._stage = stage
        self.step(0, 0, stage)

    def stages(self) -> dict[str, float]:
        """Return the seconds of all stages, the running one until now."""
        now = time.perf_counter()
        self._stages[self._stage] = self._stages.get(self._stage, 0.0) + now - self._last
        self._last = now
        return dict(self._stages)

    def step(self, done: int, total: int, what: str) -> None:
        """Pass progress on."""
        if self._progress is not None:
            self._progress(done, total, what)

    def total(self) -> dict[str, float]:
        """Return the seconds of all stages and their ``total``."""
        return {**self.stages(), "total": self._last - self._start}
