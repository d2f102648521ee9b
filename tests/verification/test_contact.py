"""Where the cutter may touch the part: programs whose answer is known, random ones run outside.

The rule of planner and verification is in ``process.material``; the one it is judged by here is
written anew in ``tools.bench.outside``.
"""

import numpy as np
import pytest

from postproc.geometry import rotation_from_vector, transform
from postproc.jobs.convert import ConvertRequest, convert
from postproc.jobs.verify import verify as verify_job
from postproc.kinematics import build
from postproc.model import MoveKind
from postproc.process import on_the_way_out
from postproc.units import DEG
from postproc.verification.verify import verify
from tests.samples import AT_PART, HEAD, START, at, cell_in, modules
from tools.bench.outside import Machine, Way, allowed, moves_of, ways_of
from tools.bench.solids import Judge
from tools.fuzz.run import run

SOLIDS = """
[[tool.meshes]]
box = { size_mm = [60, 60, 60] }
xyz_mm = [37, 0, 362]
[[tool.meshes]]
cylinder = { radius_mm = 4, length_mm = 40 }
xyz_mm = [87, 0, 362]
abc_deg = [0, 90, 0]
cutting = true
[[workpiece.meshes]]
box = { size_mm = [20, 200, 200] }
xyz_mm = [10, 0, 0]
[limits]
clearance_mm = 1.0
"""
SLOW, FAST = "$VEL.CP=0.010000", "$VEL.CP=0.800000"
FEED = 0.25
TOP = [START, FAST, at(-20, 0, 0)]
DRILLED = [*TOP, SLOW, at(6, 0, 0), FAST]
CASES = {
    "drilled and left": ([*DRILLED, at(-20, 0, 0)], True),
    "left with the feed, then in rapid": ([*DRILLED, SLOW, at(3, 0, 0), FAST, at(-20, 0, 0)], True),
    "back into what was drilled": (
        [*DRILLED, at(-4, 0, 0), at(5.5, 0, 0), SLOW, at(9, 0, 0), FAST, at(-20, 0, 0)],
        True,
    ),
    "back with the feed, in again in rapid": (
        [*DRILLED, SLOW, at(-4, 0, 0), FAST, at(5.5, 0, 0), at(-20, 0, 0)],
        True,
    ),
    "deeper in rapid": ([*DRILLED, at(-4, 0, 0), at(7, 0, 0), at(-20, 0, 0)], False),
    "into the part in rapid": ([*TOP, at(6, 0, 0), at(-20, 0, 0)], False),
    "out sideways": ([*DRILLED, at(6, 30, 0), at(-20, 30, 0)], False),
    "out aslant": ([*DRILLED, at(-20, 3, 0)], False),
    "out along another axis": (
        [*DRILLED, at(-20, 0, 0).replace("B 0.0", "B 2.0")],
        False,
    ),
    "out by the joints": ([*DRILLED, START], False),
    "beside the hole": ([*DRILLED, at(-20, 0, 0), at(-20, 2, 0), at(3, 2, 0)], False),
    "a slot": ([*DRILLED[:-1], at(6, 40, 10), at(6, 40, -30), FAST, at(-20, 40, -30)], True),
    "out where the slot began": ([*DRILLED[:-1], at(6, 40, 0), FAST, at(6, 0, 0)], False),
    "across the part": ([*TOP, at(-20, -110, 0), at(3, -110, 0), at(3, 110, 0)], False),
    "beside the part": ([*TOP, at(-20, -110, 0), at(3, -110, 0), at(3, -110, 60)], True),
    "the holder in the part": ([*TOP, SLOW, at(45, 0, 0), FAST, at(-20, 0, 0)], False),
    "a corner cut short in the part": (
        [*TOP, SLOW, at(6, 0, 0, "C_DIS"), FAST, at(6, 5, 0), at(-20, 5, 0)],
        False,
    ),
}

WIDER = {"out where the slot began"}
"""What the rule from outside allows: the way back along all that was cut."""


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"), SOLIDS, **AT_PART)


@pytest.fixture(scope="module")
def outside(cell):
    arm = build(cell.robot)
    return Machine(cell, arm), Judge(cell, arm, cell.limits.clearance)


def refused(cell, lines):
    report = verify(modules(*HEAD, *lines), "T", cell)
    assert report.collisions_checked
    others = {item.code for item in report.violations} - {"collision", "corner"}
    assert not others, [str(item) for item in report.violations]
    return any(item.code == "collision" for item in report.violations)


def hit(outside, cell, lines):
    machine, judge = outside
    moves = moves_of("\r\n".join([*HEAD, *lines]), 0)
    ways = ways_of(machine, moves, np.random.default_rng(1), FEED, 4)
    assert all(way.what != "lost" for way in ways)
    allowed(ways, np.asarray(cell.tool.axis))
    return any(judge.met(way.q, way.touch) for way in ways)


@pytest.mark.parametrize("name", CASES)
def test_programs_whose_answer_is_known(cell, outside, name):
    lines, good = CASES[name]
    assert refused(cell, lines) != good
    if name not in WIDER:
        assert hit(outside, cell, lines) != good


def random_lines(rng):
    """Rapids and cuts over and in the part, most of them as a post would order them."""
    lines, y, z = [*TOP], 0.0, 0.0
    for _ in range(int(rng.integers(1, 4))):
        y, z = rng.uniform(-80.0, 80.0, 2)
        depth = rng.uniform(1.0, 12.0)
        lines += [FAST, at(-20, y, z)]
        lines += [at(-3, y, z), SLOW, at(depth, y, z)]
        kind = rng.choice(["out", "slot", "peck", "wrong"], p=[0.3, 0.25, 0.25, 0.2])
        if kind == "slot":
            y, z = np.clip(np.add([y, z], rng.uniform(-40.0, 40.0, 2)), -85.0, 85.0)
            lines.append(at(depth, y, z))
        elif kind == "peck":
            back = depth + rng.choice([-0.5, 1.0], p=[0.8, 0.2])
            lines += [FAST, at(rng.uniform(-5.0, 0.0), y, z), at(back, y, z)]
            lines += [SLOW, at(depth + 2.0, y, z)]
        elif kind == "wrong":
            side = rng.choice([0.0, 0.5, 5.0], 2) * rng.choice([-1.0, 1.0], 2)
            lines += [FAST, at(rng.uniform(-2.0, depth), y + side[0], z + side[1])]
        lines += [FAST, at(-20, y, z)]
    return lines


@pytest.mark.parametrize("seed", range(4))
def test_nothing_that_hits_outside_is_let_pass(cell, outside, seed):
    rng = np.random.default_rng(seed)
    answers = []
    for _ in range(12):
        lines = random_lines(rng)
        answers.append((hit(outside, cell, lines), refused(cell, lines)))
        assert answers[-1] in ((True, True), (False, False)), lines
    assert len(set(answers)) == 2


def test_the_rule_is_never_wider_than_the_one_from_outside():
    """Tools near the way out of a cut, on it and off it, in all directions."""
    rng = np.random.default_rng(5)
    axis = np.array([1.0, 0.0, 0.0])
    n = 400
    R = rotation_from_vector(rng.uniform(-3.0, 3.0, 3))
    cut = transform(R, rng.uniform(-1.0, 1.0, 3))
    size = rng.choice([0.0, 1e-5, 1e-4, 1e-3, 0.1], (n, 3))
    off = rng.choice([-1.0, 1.0], (n, 3)) * size
    lean = np.where(rng.uniform(size=(n, 1)) < 0.5, 0.0, rng.normal(size=(n, 3)) * 0.2 * DEG)
    T = np.array(
        [cut @ transform(rotation_from_vector(v), p) for v, p in zip(lean, off, strict=True)]
    )
    ways = [
        Way(1, "motion", np.zeros((1, 6)), cut[None], at_feed=True),
        Way(2, "motion", np.zeros((n, 6)), T, at_feed=False),
    ]
    allowed(ways, axis)
    rows = np.ones((n, 1))
    own = on_the_way_out(rows * cut[:3, 3], rows * (R @ axis), T[:, :3, 3], T[:, :3, :3] @ axis)
    assert not (own & ~ways[1].touch).any()
    assert own.sum() > 20
    exact = (size[:, 1:] == 0.0).all(axis=1) & (off[:, 0] <= 0.0) & (lean == 0.0).all(axis=1)
    assert exact.sum() > 5
    assert own[exact].all()


PART = """PARTNO/SLOT
UNITS/MM
MULTAX/ON
SPINDL/3000,RPM,CLW
RAPID
GOTO/-20.,0.,0.,-1.,0.,0.
FEDRAT/600.,MMPM
GOTO/6.,0.,0.
GOTO/6.,30.,0.
RAPID
GOTO/-20.,30.,0.
RAPID
GOTO/-20.,60.,0.
FEDRAT/600.,MMPM
GOTO/6.,60.,0.
RAPID
GOTO/-3.,40.,0.
RAPID
GOTO/-20.,40.,0.
SPINDL/OFF
FINI
"""


def converted(tmp_path, text=PART):
    (tmp_path / "part.apt").write_text(text)
    cell_in(tmp_path, SOLIDS, **AT_PART)
    request = ConvertRequest(str(tmp_path / "part.apt"), str(tmp_path / "cell.toml"))
    return convert(request)


def test_the_planner_runs_rapids_out_of_a_cut_as_the_file_does_and_no_others(tmp_path, cell):
    """The way out is straight; one aslant through the part is replaced by one over it."""
    done = converted(tmp_path)
    assert done.good
    plan = done.plan
    tags = [int(np.flatnonzero(plan.tag == tag)[-1]) for tag in (3, 6)]
    assert [plan.kind[row] for row in tags] == [MoveKind.LIN, MoveKind.PTP]
    assert (plan.tag == 3).sum() == 1
    assert (plan.tag == 6).sum() > 1
    for name, content in done.files.items():
        (tmp_path / name).write_bytes(content)
    assert not verify_job(tmp_path / f"{done.name}.src", cell).violations


DEEP = """PARTNO/DEEP
UNITS/MM
MULTAX/ON
SPINDL/3000,RPM,CLW
CYCLE/DRILL,DEEP,STEP,{step},CLEAR,3.0,FEDTO,8.0,RTRCTO,20.,MMPM,200.
GOTO/0.,0.,0.,-1.,0.,0.
CYCLE/OFF
SPINDL/OFF
FINI
"""


@pytest.mark.parametrize("last_mm", [0.001, 0.0185, 0.067, 0.3, 4.0])
def test_the_last_peck_cuts_however_small_it_is(tmp_path, last_mm):
    """Less than what counts as on the axis; the cutter stands in the part there."""
    done = converted(tmp_path, DEEP.format(step=(8.0 - last_mm) / (2.0 if last_mm < 1.0 else 1.0)))
    assert [str(f) for f in done.findings if f.is_error] == []


def test_a_rapid_that_an_axis_slows_down_is_no_cut(tmp_path):
    """Straight at 0.12 m/s while the spindle stands, its text alone read as a cut."""
    outcome = run(1, 1_204_623, tmp_path)
    assert outcome.faults == []
    assert outcome.good == 1
