"""Scripts of ours that run foreign code in a process which can be ended."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_LIMITED = """
import runpy, sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[1]), int(sys.argv[1])))
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]), int(sys.argv[2])))
except ImportError:
    pass
sys.argv = sys.argv[3:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
_PATIENCE = 4
"""The clock on the wall may run so much longer than that of the processor on a busy machine."""


def run_bounded(
    script: Path, arguments: Sequence[str], seconds: int, memory: int, text: str = ""
) -> tuple[int, str] | None:
    """Run a script with Python's own limits on time of the processor [s] and memory [bytes].

    It imports nothing of this package, and gets arguments and a text on stdin. Returns exit code
    and stdout; None where it was ended.
    """
    call = [sys.executable, "-P", "-c", _LIMITED, str(seconds), str(memory), str(script)]
    try:
        done = subprocess.run(
            [*call, *arguments],
            input=text.encode("utf-8"),
            capture_output=True,
            timeout=_PATIENCE * seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None
    if done.returncode < 0:
        return None
    return done.returncode, done.stdout.decode("utf-8", "replace")
