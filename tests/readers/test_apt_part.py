"""One part in every dialect: the same path, whatever the system wrote.

The expected path is written down here by hand, in millimetres; it is not output of the readers.
"""

from pathlib import Path

import numpy as np
import pytest

from postproc.model.toolpath import CycleKind, EventKind, MotionKind
from postproc.readers import ReadOptions, read

R, L, A, H = MotionKind.RAPID, MotionKind.LINEAR, MotionKind.ARC, MotionKind.HOLE
PART = [
    (0, 0, 50, R, None), (10, 0, 2, R, None), (10, 0, -3, L, 200), (40, 0, -3, L, 600),
    (50, 10, -3, A, 600), (50, 30, -3, L, 600), (60, 40, -3, A, 600), (80, 40, -3, L, 600),
    (80, 40, 50, R, None), (20, 60, 2, R, None), (20, 60, -3, L, 200), (20, 60, -3, A, 200),
    (20, 60, 5, L, 200), (10, 70, 0, H, 120), (30, 70, 0, H, 120), (50, 70, 0, H, 120),
    (50, 70, 50, R, None),
]  # fmt: skip
"""x, y, z [mm], motion, feed [mm/min]."""
ARCS = [((40, 10, -3), 1, 10, 90), ((60, 30, -3), -1, 10, 90), ((25, 60, -3), 1, 5, 360)]
"""Centre [mm], sense about +z, radius [mm], sweep [deg]."""
FILES = {
    "part.cls": "nx",
    "part.apt": "solidworks",
    "part.ncl.3": "creo",
    "part.aptsource": "catia",
    "part.clt": "camworks",
    "part_plain.apt": "apt",
    "part_fusion.apt": "fusion",
    "part_hsmworks.apt": "hsmworks",
    "part_mfgsuite.apt": "mfgsuite",
    "part_camplete.apt": "camplete",
    "part_manusnc.apt": "manusnc",
    "part_postworks.apt": "postworks",
    "part_surfcam.apt": "surfcam",
}
OPTIONS = ReadOptions(cycle_words="depth clearance retract peck dwell feed")


@pytest.fixture(scope="module", params=list(FILES))
def toolpath(request, fixtures):
    ordered = FILES[request.param] == "catia"
    return read(fixtures / request.param, options=OPTIONS if ordered else None)


def test_the_dialect_is_found(toolpath):
    dialect = FILES[Path(toolpath.path).name]
    assert (toolpath.format, toolpath.dialect, toolpath.units) == ("apt", dialect, "mm")


def test_points_axes_motions_and_feeds(toolpath):
    expected = np.array([row[:3] for row in PART]) * 1e-3
    assert np.abs(toolpath.points - expected).max() < 1e-12
    assert (toolpath.axes == [0, 0, 1]).all()
    assert toolpath.kind.tolist() == [row[3] for row in PART]
    feeds = np.array([np.nan if row[4] is None else row[4] for row in PART]) / 60e3
    np.testing.assert_allclose(toolpath.feed, feeds, rtol=1e-12)


def test_arcs_turn_the_way_the_part_was_cut(toolpath):
    arcs = toolpath.arcs
    np.testing.assert_allclose(arcs.centre * 1e3, [a[0] for a in ARCS], atol=1e-9)
    np.testing.assert_allclose(arcs.normal, [(0, 0, a[1]) for a in ARCS], atol=1e-12)
    np.testing.assert_allclose(arcs.radius * 1e3, [a[2] for a in ARCS], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(arcs.sweep), [a[3] for a in ARCS], rtol=1e-12)
    assert toolpath.arc[toolpath.kind == A].tolist() == [0, 1, 2]


def test_one_drill_cycle_for_all_holes(toolpath):
    (cycle,) = toolpath.cycles
    assert toolpath.cycle.tolist() == [0 if row[3] is H else -1 for row in PART]
    assert cycle.kind is CycleKind.DEEP
    heights = (cycle.depth, cycle.clearance, cycle.retract, cycle.peck_first, cycle.peck)
    np.testing.assert_allclose(heights, (8e-3, 3e-3, 12e-3, 2e-3, 2e-3), rtol=1e-12)
    assert cycle.dwell == 0.5


def test_tools_and_their_changes(toolpath):
    assert [tool.number for tool in toolpath.tools] == [1, 2]
    np.testing.assert_allclose([tool.diameter for tool in toolpath.tools], [0.010, 0.0048])
    assert toolpath.tool.tolist() == [0] * 13 + [1] * 4
    changes = [e for e in toolpath.events if e.kind is EventKind.TOOL_CHANGE]
    assert [(event.index, event.value) for event in changes] == [(0, 1.0), (13, 2.0)]


def test_spindle_and_coolant(toolpath):
    kinds = {event.kind: event for event in toolpath.events}
    assert kinds[EventKind.SPINDLE_ON].value == pytest.approx(50.0)
    assert kinds[EventKind.SPINDLE_ON].index == kinds[EventKind.COOLANT_ON].index == 0


def test_every_tag_knows_its_line(toolpath):
    lines = Path(toolpath.path).read_text(encoding="latin-1").splitlines()
    for line in toolpath.line.tolist():
        assert lines[line - 1].lstrip().startswith(("GOTO", "GODLTA", "TLON"))


def test_no_word_is_unknown(toolpath):
    assert toolpath.unknown_words == {}
    assert toolpath.recovered == ()


def test_creo_and_solidworks_name_what_they_name(fixtures):
    creo = read(fixtures / "part.ncl.3")
    assert [o.name for o in creo.operations] == ["FEATNO 11", "FEATNO 12"]
    solidworks = read(fixtures / "part.apt")
    assert solidworks.tools[0].name == "[HOLDER=C40-A, B/2] 10MM 3FL, 25 LOC"
    assert solidworks.tools[1].name == "4.8mm JOBBER DRILL"


def test_latin1_text_is_kept(fixtures):
    catia = read(fixtures / "part.aptsource", options=OPTIONS)
    texts = [event.text for event in catia.events if event.kind is EventKind.MESSAGE]
    assert texts == ["PART TO BE MACHINED, 1/2", "T1 Fraise D 10, Rc 0"]


def test_a_forced_dialect_wins_over_the_sniffed_one(fixtures, read_text):
    milling = (fixtures / "part.cls").read_text().partition("TOOL PATH/HOLES")[0] + "FINI\n"
    as_nx = read_text(milling)
    as_creo = read_text(milling, dialect="creo")
    assert (as_nx.dialect, as_creo.dialect) == ("nx", "creo")
    assert (as_creo.arcs.normal == -as_nx.arcs.normal).all()
