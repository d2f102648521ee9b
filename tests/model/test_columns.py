"""Rows of toolpaths and plans: every column follows, also one that nobody thought of."""

from dataclasses import dataclass, field, fields, replace

import numpy as np
import pytest

from postproc.arrays import column, taken
from postproc.errors import Finding, Severity
from postproc.model import Arcs, CamSetup, Event, EventKind, MotionKind, MoveKind, Plan, ToolPath
from tests.emitters.plans import plan as plan_of
from tests.emitters.plans import toolpath as toolpath_of

N = 6


@dataclass(frozen=True, slots=True)
class LoadedPath(ToolPath):
    """A toolpath with one more column."""

    load: np.ndarray | None = field(default=None, metadata=column("tag", 2))


@dataclass(frozen=True, slots=True)
class HeatedPlan(Plan):
    """A plan with one more column of moves and one of tags."""

    heat: np.ndarray | None = field(default=None, metadata=column("move"))
    wear: np.ndarray | None = field(default=None, metadata=column("tag"))


def values_of(whole):
    return {f.name: getattr(whole, f.name) for f in fields(whole)}


def numbered(n, *shape, start=0.0):
    size = int(np.prod(shape, dtype=int))
    return start + np.arange(n * size, dtype=float).reshape(n, *shape)


def full_path(events=()):
    """A toolpath of which every column holds something else in every row."""
    path = toolpath_of(N, operations=("A", "B"), operation=[0, 0, 0, 1, 1, -1])
    changes = values_of(path) | {
        "points": numbered(N, 3),
        "axes": numbered(N, 3, start=50.0),
        "kind": [MotionKind.RAPID, MotionKind.ARC] + [MotionKind.HOLE] * 4,
        "feed": numbered(N, start=0.1),
        "tool": [-1] * N,
        "setup": [0, 0, 1, 1, 0, -1],
        "setups": (CamSetup("A", 1), CamSetup("B", 2)),
        "arc": [-1, 0, -1, -1, -1, -1],
        "arcs": Arcs(numbered(1, 3), numbered(1, 3), np.ones(1), np.ones(1)),
        "rotations": numbered(N, 3, 3),
        "joints": numbered(N, 6),
        "names": tuple("abcdef"),
        "extra": {"diameter": numbered(N), "note": list("uvwxyz")},
        "words": {"GOTO": 3},
        "events": tuple(events),
    }
    return LoadedPath(**changes, load=numbered(N, 2, start=9.0))


def columns(whole, of):
    return [f.name for f in fields(whole) if f.metadata.get("column") and
            f.metadata["column"].of == of]  # fmt: skip


def test_every_array_of_a_toolpath_is_declared_a_column():
    path = full_path()
    arrays = {name for name, value in values_of(path).items() if isinstance(value, np.ndarray)}
    assert arrays | {"names", "extra"} == set(columns(path, "tag"))


def test_every_array_of_a_plan_is_declared_a_column():
    frames = {"tool": np.zeros(2), "base": np.ones(2)}
    doubt = {"compensation_u95": np.ones(2), "compensation_inside": np.ones(2)}
    shifts = {"compensation": np.zeros((2, 3)), "shift_along": np.zeros((2, 3)), **doubt}
    plan = replace(plan_of([{}, {}]), **shifts, orientation_speed=np.ones(2), **frames)
    arrays = {name for name, value in values_of(plan).items() if isinstance(value, np.ndarray)}
    assert arrays == {*columns(plan, "move"), *columns(plan, "tag")}


def test_rows_of_a_toolpath_take_every_column():
    path, index = full_path(), np.array([4, 1, 2])
    part = path.rows(index)
    assert isinstance(part, LoadedPath)
    for name in columns(path, "tag"):
        whole, own = getattr(path, name), getattr(part, name)
        if name == "names":
            assert own == ("e", "b", "c")
        elif name == "extra":
            np.testing.assert_array_equal(own["diameter"], [4.0, 1.0, 2.0])
            assert own["note"] == ("y", "v", "w")
        else:
            np.testing.assert_array_equal(own, whole[index])


def test_events_stay_with_their_tags():
    at = (0, 2, 3, 6)
    path = full_path([Event(i, EventKind.MESSAGE, text=str(i)) for i in at])
    kept = path.rows(np.array([2, 3, 5])).events
    assert [(event.text, event.index) for event in kept] == [("2", 0), ("3", 1), ("6", 3)]
    assert [event.text for event in path.rows(np.arange(2)).events] == ["0"]


def test_a_run_in_another_order_keeps_its_events_around_it():
    path = full_path([Event(i, EventKind.STOP) for i in (2, 5)])
    turned = path.rows(np.array([0, 1, 4, 2, 3, 5]))
    assert [event.index for event in turned.events] == [2, 5]


def test_parts_of_a_toolpath_join_to_the_whole():
    path = full_path([Event(i, EventKind.STOP) for i in (0, 2, 4, 6)])
    parts = [path.rows(np.arange(2)), path.rows(np.arange(2, N))]
    whole = ToolPath.concat(parts)
    for name in (*columns(path, "tag"), "events"):
        if name in ("operation", "setup", "arc", "extra"):
            continue
        np.testing.assert_array_equal(getattr(whole, name), getattr(path, name))
    assert [op.name for op in whole.operations] == ["A", "B", "A", "B"]
    assert whole.operation.tolist() == [0, 0, 2, 3, 3, -1]
    assert whole.setup.tolist() == [0, 0, 3, 3, 2, -1]
    assert whole.arc.tolist() == [-1, 0, -1, -1, -1, -1]
    assert len(whole.arcs) == 2
    assert whole.words == {"GOTO": 6}


def test_joined_toolpaths_need_the_same_columns():
    path = full_path()
    with pytest.raises(ValueError, match="joints"):
        ToolPath.concat([path, replace(path, joints=None)])


def test_a_column_of_another_length_is_refused():
    with pytest.raises(ValueError, match="diameter"):
        replace(full_path(), extra={"diameter": [1.0]})
    with pytest.raises(ValueError, match=r"names.*2 values for 6 rows"):
        replace(full_path(), names=("a", "b"))


def heated(kinds=(MoveKind.PTP, MoveKind.LIN, MoveKind.LIN), **changes):
    plain = plan_of([{"kind": kind} for kind in kinds], **changes)
    m, n = len(plain), len(plain.toolpath)
    return HeatedPlan(**values_of(plain), heat=numbered(m), wear=numbered(n))


def test_rows_of_a_plan_take_every_column_of_its_moves():
    plan, index = (
        heated(events=((2, Event(2, EventKind.STOP)), (3, Event(3, EventKind.STOP)))),
        (np.array([0, 1, 1, 1, 2])),
    )
    part = plan.rows(index)
    for name in columns(plan, "move"):
        if getattr(plan, name) is not None:
            np.testing.assert_array_equal(getattr(part, name), getattr(plan, name)[index])
    for name in columns(plan, "tag"):
        np.testing.assert_array_equal(getattr(part, name), getattr(plan, name))
    assert [move for move, _ in part.events] == [4, 5]


def test_parts_of_a_plan_join_to_the_whole():
    plan = heated(events=((1, Event(1, EventKind.STOP)),))
    whole = Plan.concat([plan.rows(np.arange(1)), plan.rows(np.arange(1, 3))])
    for name in (*columns(plan, "move"), *columns(plan, "tag")):
        if getattr(plan, name) is not None:
            np.testing.assert_array_equal(getattr(whole, name), getattr(plan, name))


def test_the_plan_of_a_stretch_becomes_one_of_the_whole():
    finding = Finding(Severity.ERROR, "PLN101", "out of reach", 1)
    part = replace(heated(), findings=(finding,), stiffness=[1.0, 2.0, 3.0])
    path = toolpath_of(10, operations=("A",))
    whole = part.within(path, 4)
    assert whole.tag.tolist() == [4, 5, 6]
    assert [i.tag_index for i in whole.findings] == [5]
    np.testing.assert_array_equal(whole.stiffness[4:7], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(whole.wear[4:7], part.wear)
    assert np.isnan(np.delete(whole.wear, [4, 5, 6])).all()


@pytest.mark.parametrize("shape", [(7,), (7, 6), (7, 4, 4)])
def test_rows_taken_are_those_indexed(shape):
    values = np.random.default_rng(2).normal(size=shape).astype(np.float32)
    for rows in (np.array([3, 0, 0, -1]), np.zeros(0, dtype=np.int64), np.arange(7) % 2 == 0):
        found = taken(values, rows)
        assert found.dtype == values.dtype
        assert np.array_equal(found, values[rows])
