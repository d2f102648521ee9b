"""What the benches share: processor time, memory, one process a case.

Processor time is that of all threads together, so other work on the machine matters little; ratios
carry over to other machines, absolute numbers do not.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass
class Spent:
    """Seconds that a block took; ``cpu`` with its ended child processes."""

    wall: float = 0.0
    cpu: float = 0.0


@contextmanager
def spent() -> Iterator[Spent]:
    """Measure a block; the seconds are there when it has ended."""
    result = Spent()
    wall, cpu = time.perf_counter(), _cpu()
    try:
        yield result
    finally:
        result.wall, result.cpu = time.perf_counter() - wall, _cpu() - cpu


def _cpu() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def told(what: str, work: Callable[[], T]) -> T:
    """Run something, print its processor time, return its result."""
    with spent() as used:
        result = work()
    print(f"{used.cpu:7.2f} s  {what}")
    return result


def rate(work: Callable[[], object], count: int, repeats: int = 1) -> float:
    """Return items per second of processor time, the best of several runs of ``count`` items."""
    best = float("inf")
    for _ in range(repeats):
        with spent() as used:
            work()
        best = min(best, used.cpu)
    return count / best


def peak_mb() -> float:
    """Return the most memory that this process has had [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def alone(*words: str, python: str | None = None) -> dict[str, Any]:
    """Run one case in a process of its own, so that its peak memory is its own.

    Args:
        words: of ``python -m tools.bench``; of another interpreter: its script and arguments.
        python: that interpreter.

    Returns:
        The JSON object of the last line that it prints.
    """
    command = [python, *words] if python else [sys.executable, "-m", "tools.bench", *words]
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=one_thread)
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result
