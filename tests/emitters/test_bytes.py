"""Every form of a KUKA program is the same in any process."""

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = """
import hashlib, sys
sys.path.insert(0, {tests!r})
from emitters import plans
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.model.toolpath import EventKind
events = [plans.event(i, kind, 1.0, "text") for i, kind in enumerate(EventKind)]
own = {{"tap_reverse": "TAP_BACK", "spindle_orient": "TURN_TO"}}  # have no default routine
path = plans.toolpath(31, operations=("a", "b", "c"), operation=[i // 11 for i in range(31)])
for krl in ({{}}, {{"motion": "forms"}}, {{"points": "dat"}}, {{"motion": "spline_block"}}):
    cell = plans.cell(setup=True, hooks_example=True, max_points_per_file=7, hooks=own, **krl)
    files = render_files(emit(plans.milling(30, events=events, path=path), cell))
    for name, content in files.items():
        print(name, hashlib.sha256(content).hexdigest())
"""


def test_the_hash_seed_does_not_matter():
    script = SCRIPT.format(tests=str(Path(__file__).resolve().parent.parent))
    outputs = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2", "77")
    }
    assert len(outputs) == 1
    assert "PP_HOOKS.src" in outputs.pop()
