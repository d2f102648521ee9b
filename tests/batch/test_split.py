"""Large inputs in several programs: what belongs together stays, what changed is redone."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.batch.fingerprint import content_hash
from postproc.batch.jobs import Job
from postproc.batch.sections import parse_rule, section_labels, split_job, subset
from postproc.errors import DataError
from postproc.jobs.convert import ConvertRequest
from postproc.model.toolpath import (
    Arcs,
    Cycle,
    Event,
    EventKind,
    MotionKind,
    Operation,
    ToolPath,
)

from .conftest import HEADER, row

HOLE, RAPID, LINEAR, ARC = MotionKind.HOLE, MotionKind.RAPID, MotionKind.LINEAR, MotionKind.ARC


def make_path(kinds, points=None, operation=None, events=(), **more):
    n = len(kinds)
    none = np.full(n, -1)
    columns = {
        "points": np.zeros((n, 3)) if points is None else np.asarray(points, float),
        "axes": np.tile([0.0, 0, 1], (n, 1)),
        "kind": np.array(kinds),
        "feed": np.full(n, 0.01),
        "line": np.arange(n) + 1,
        "operation": none if operation is None else np.array(operation),
        "tool": none, "arc": none, "cycle": none,
    }  # fmt: skip
    return ToolPath(
        path="x.cls", name="x", format="apt", dialect="nx", units="mm", events=tuple(events),
        **{**columns, **more},
    )  # fmt: skip


def sections(path, rule):
    return {label: rows.tolist() for label, rows in section_labels(path, parse_rule(rule))}


def parts_of(path, rule, name="WING", taken=None):
    job = Job("wing.cls", ConvertRequest("wing.cls", "cell.toml", name=name))
    return split_job(job, path, parse_rule(rule), set() if taken is None else taken)


@pytest.mark.parametrize("rule", ["region:100", "count:3", "operation"])
def test_large_inputs_become_several_programs_and_a_caller(batch, work, rule):
    cloud = HEADER + "".join(row(20 * i, 30 * (i % 3)) for i in range(10))
    (work / "cloud.csv").write_text(cloud)
    done = batch("--split", rule, inputs=("cloud.csv",))
    assert done.code == 0, done.err
    entries = done.document["entries"]
    caller = entries["cloud.csv"]
    text = (work / "out" / f"{caller['program']}.src").read_text()
    others = {e["program"] for key, e in entries.items() if key != "cloud.csv"}
    assert all(f"{name}()" in text for name in others)
    assert sum(e["tags"] for e in entries.values()) == 10
    assert batch("--split", rule, inputs=("cloud.csv",)).document["done"] == 0
    assert batch("--split", rule, "--check", inputs=("cloud.csv",)).code == 0
    (work / "out" / f"{caller['program']}.src").unlink()
    assert batch("--split", rule, "--check", inputs=("cloud.csv",)).code == 1


def test_one_more_hole_changes_only_its_own_region(batch, work, snapshot):
    rows = [row(20 * i) for i in range(12)]
    (work / "cloud.csv").write_text(HEADER + "".join(rows))
    batch("--split", "region:80", inputs=("cloud.csv",))
    before = snapshot("out")
    rows.insert(5, row(110, 15))
    (work / "cloud.csv").write_text(HEADER + "".join(rows))
    done = batch("--split", "region:80", inputs=("cloud.csv",))
    after = snapshot("out")
    changed = {name for name in before | after if before.get(name) != after.get(name)}
    assert changed - {"manifest.json"} == {"cloud_X1Y0Z0.src"}
    assert done.document["done"] == 1


def test_without_a_good_section_there_is_no_caller(batch, work):
    (work / "cloud.csv").write_text(HEADER + row(0) + row(120))
    assert batch("--split", "region:100", inputs=("cloud.csv",)).code == 0
    (work / "cloud.csv").write_text(HEADER + row(0) + row(9000))
    done = batch("--split", "region:100", "--prune", inputs=("cloud.csv",))
    assert done.code == 1
    assert "cloud.csv:1: error BAT015: 1 of 2 sections failed" in done.err
    assert {p.name for p in (work / "out").iterdir()} == {
        "cloud_X0Y0Z0.src", "cloud_X0Y0Z0.dat", "manifest.json",
    }  # fmt: skip


def test_regions_follow_the_decimal_numbers_of_the_file():
    points = np.array([[0.1 * k, 0, 0] for k in range(-3, 8)])
    found = sections(make_path([HOLE] * 11, points), "region:100")
    assert found["X3Y0Z0"] == [6]
    assert found["XN3Y0Z0"] == [0]


def test_regions_need_holes_only():
    with pytest.raises(DataError, match="BAT041"):
        sections(make_path([RAPID, LINEAR]), "region:10")
    stop = Event(1, EventKind.STOP, line=7)
    with pytest.raises(DataError, match=r"x\.cls:7: error BAT041"):
        sections(make_path([HOLE, HOLE], events=[stop]), "region:10")


def test_counts_never_cut_a_cut_in_two():
    kinds = [RAPID, LINEAR, LINEAR, LINEAR, RAPID, LINEAR, RAPID, LINEAR]
    assert sections(make_path(kinds), "count:2") == {
        "001": [0, 1, 2, 3], "002": [4, 5], "003": [6, 7],
    }  # fmt: skip


def test_operations_that_look_alike_stay_apart():
    names = ("DRILL LARGE HOLES A", "DRILL LARGE HOLES B", "Ø 5", "Ø 5")
    operations = tuple(Operation(name) for name in names)
    path = make_path([HOLE] * 4, operation=[0, 1, 2, 3], operations=operations)
    jobs = parts_of(path, "operation")
    assert len({job.key for job in jobs}) == 4
    assert len({str(job.request.name).upper() for job in jobs}) == 4


def test_long_names_of_inputs_stay_apart():
    path = make_path([HOLE] * 2)
    taken = set()
    one = parts_of(path, "count:1", "LEFT_UPPER_WING_SKIN_ONE", taken)
    two = parts_of(path, "count:1", "LEFT_UPPER_WING_SKIN_TWO", taken)
    names = [str(job.request.name) for job in one + two]
    assert len(set(names)) == 4
    assert all(len(name) <= 20 for name in names)


def test_no_section_ends_in_a_cut():
    """The tool would come straight down into the middle of it, or never come out."""
    kinds = [RAPID, LINEAR, LINEAR, LINEAR, RAPID, RAPID, LINEAR, HOLE, LINEAR]
    points = np.arange(9)[:, None] * [0.1, 0, 0]
    path = make_path(kinds, points, operation=[0, 0, 1, 1, 1, 1, 1, 1, 0])
    path = replace(path, operations=(Operation("A"), Operation("B")))
    first, second = (job.toolpath for job in parts_of(path, "operation"))
    assert first.kind.tolist() == [RAPID, LINEAR, LINEAR, LINEAR, RAPID]
    assert second.kind.tolist() == [RAPID, RAPID, LINEAR, HOLE, LINEAR]
    assert np.allclose(first.points, points[:5])
    assert np.allclose(second.points, points[4:])


def test_sections_carry_their_tool_spindle_and_coolant():
    events = [
        Event(0, EventKind.TOOL_CHANGE, 4.0),
        Event(0, EventKind.SPINDLE_ON, 50.0),
        Event(1, EventKind.COOLANT_ON),
        Event(2, EventKind.COOLANT_OFF),
        Event(3, EventKind.SPINDLE_ON, 70.0),
        Event(5, EventKind.SPINDLE_OFF),
    ]
    path = make_path([HOLE] * 5, events=events)

    def seen(rows):
        part = subset(path, np.array(rows))
        return [(event.index, str(event.kind), event.value) for event in part.events]

    tool, spindle = (0, "tool_change", 4.0), (0, "spindle_on", 50.0)
    coolant = [(1, "coolant_on", 0.0), (2, "coolant_off", 0.0)]
    end = (2, "spindle_off", 0.0)
    assert seen([0, 1]) == [tool, spindle, *coolant, end]
    assert seen([2, 4]) == [tool, spindle, (0, "coolant_off", 0.0), end]
    assert seen([3, 4]) == [tool, (0, "spindle_on", 70.0), end]


def test_a_section_takes_only_the_tables_that_it_uses():
    n = 6
    cycles = tuple(Cycle("drill", 0.001 * k, 0.002, 0.01) for k in range(n))
    path = make_path(
        [HOLE] * n, cycle=np.arange(n), cycles=cycles,
        extra={"diameter": np.arange(n), "label": tuple("abcdef")},
    )  # fmt: skip
    part = subset(path, np.array([1, 4]))
    assert [c.depth for c in part.cycles] == [0.001, 0.004]
    assert part.cycle.tolist() == [0, 1]
    assert part.extra["diameter"].tolist() == [1, 4]
    assert part.extra["label"] == ("b", "e")


def test_everything_but_the_place_in_the_file_counts():
    arcs = Arcs(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.ones(1), np.ones(1))
    path = make_path(
        [RAPID, ARC], arc=np.array([-1, 0]), arcs=arcs, events=[Event(0, EventKind.SPINDLE_ON, 5.0)]
    )
    base = content_hash(path)
    moved = replace(
        path, line=path.line + 9, events=(replace(path.events[0], line=12),), path="y.cls"
    )
    assert content_hash(moved) == base
    other = Arcs(arcs.centre, -arcs.normal, arcs.radius, arcs.sweep)
    changes = [
        {"arcs": other},
        {"events": (Event(0, EventKind.SPINDLE_ON, 6.0),)},
        {"joints": np.zeros((2, 6))},
        {"rotations": np.tile(np.eye(3), (2, 1, 1))},
        {"names": ("a", "b")},
        {"extra": {"diameter": np.ones(2)}},
    ]
    hashes = {content_hash(replace(path, **change)) for change in changes}
    assert len(hashes | {base}) == len(changes) + 1


@pytest.mark.parametrize("text", ["region:0", "count:1.5", "count:0", "region", "operations", "x"])
def test_a_wrong_rule_is_told(text):
    with pytest.raises(DataError, match="BAT040"):
        parse_rule(text)
