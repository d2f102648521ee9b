"""The contract of emitters, over all of them: same bytes every time, plan untouched."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from postproc.emitters.base import EMITTERS
from postproc.krl.text.names import NameAllocator
from postproc.model.toolpath import EventKind

from . import plans

EVENTS = [
    plans.event(0, EventKind.SPINDLE_ON, 100.0, "SPINDL/6000"),
    plans.event(3, EventKind.COOLANT_ON, 0.0, "COOLNT/ON"),
]


@pytest.fixture(params=[name for name, _ in EMITTERS])
def emitter(request):
    return EMITTERS.get(request.param)


def test_two_runs_give_the_same_bytes_and_leave_the_plan_alone(emitter):
    plan = plans.milling(events=EVENTS)
    before = plan.T_base_tcp.copy()
    first = emitter(plan, plans.cell(max_points_per_file=3), NameAllocator())
    second = emitter(plan, plans.cell(max_points_per_file=3))
    assert dict(first) == dict(second)
    assert list(first) == list(second)
    assert np.array_equal(plan.T_base_tcp, before)
    assert all(isinstance(content, bytes) and content for content in first.values())


def test_the_built_in_emitter_is_found():
    assert "kuka_krl" in dict(EMITTERS)


SCRIPT = """
import hashlib, sys
sys.path.insert(0, {tests!r})
from emitters import plans
from postproc.emitters.kuka.emitter import emit_files
from postproc.model.toolpath import EventKind
events = [plans.event(i, kind, 1.0, "text") for i, kind in enumerate(EventKind)]
path = plans.toolpath(31, operations=("a", "b", "c"), operation=[i // 11 for i in range(31)])
for krl in ({{}}, {{"motion": "forms"}}, {{"points": "dat"}}, {{"motion": "spline_block"}}):
    cell = plans.cell(setup=True, hooks_example=True, max_points_per_file=7, **krl)
    files = emit_files(plans.milling(30, events=events, path=path), cell)
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
