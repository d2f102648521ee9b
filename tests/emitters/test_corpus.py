"""Real CAM files: names, messages and events of five CAM systems end up in programs that read back.

The moves are made up (a line to every tag); planning is not tested here.
"""

import re

import numpy as np
import pytest

from postproc.emitters.kuka.emitter import emit, render_files
from postproc.krl.text.parse import parse_files
from postproc.model.plan import MoveKind
from postproc.model.toolpath import EventKind
from postproc.readers.base import ReadOptions, read
from tests.places import SHARED

from . import plans, texts

CORPUS = SHARED / "corpus" / "apt"
FILES = sorted(path.name for path in CORPUS.iterdir()) if CORPUS.is_dir() else []
LINES = {
    EventKind.SPINDLE_ON: r"\bPP_SPINDLE_ON\(-?[\d.]+\)",
    EventKind.SPINDLE_OFF: r"\bPP_SPINDLE_OFF\(\)",
    EventKind.COOLANT_ON: r"\bPP_COOLANT_ON\(\d\)",
    EventKind.COOLANT_OFF: r"\bPP_COOLANT_OFF\(\)",
    EventKind.DWELL: r"\bWAIT SEC [\d.]+",
    EventKind.STOP: r"\bPP_STOP\(\)",
    EventKind.OPTIONAL_STOP: r"\bPP_OPTIONAL_STOP\(\)",
    EventKind.TOOL_CHANGE: r"\bPP_TOOL_CHANGE\(\d+\)",
}


@pytest.mark.corpus
@pytest.mark.skipif(not FILES, reason="the corpus is not beside the checkout")
@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("motion", ["dense", "spline_block", "forms"])
def test_programs_of_real_files(name, motion):
    path = read(str(CORPUS / name), ReadOptions(tool_axis=(0.0, 0.0, 1.0)))
    n = min(len(path), 1500)
    moves = [{"kind": MoveKind.PTP, "xyz_mm": path.points[0] * 1e3}]
    feeds = np.where(path.feed > 0.0, path.feed, 0.5)
    moves += [
        {"xyz_mm": path.points[i] * 1e3, "speed": min(feeds[i], 1.9), "blend_mm": 1.0}
        for i in range(1, n)
    ]
    events = [(event.index, event) for event in path.events if event.index <= n]
    plan = plans.plan(moves, name=path.name, path=path, events=events)
    files = render_files(emit(plan, plans.cell(motion=motion, max_points_per_file=200)))
    read_back = parse_files(files)
    assert not [problem for module in read_back for problem in module.problems]
    assert render_files(read_back) == files
    code = "\n".join(line for src in texts.sources(files) for line in texts.code(files, src))
    for kind, pattern in LINES.items():
        assert len(re.findall(pattern, code)) == sum(event.kind is kind for _, event in events)
    for src in texts.sources(files):
        assert all(texts.INSTRUCTION.match(line) for line in texts.code(files, src))
