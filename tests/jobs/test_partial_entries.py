"""``--partial`` never joins a contact by a joint motion or in rapid: read from the text alone."""

import itertools
import re
import tempfile
from pathlib import Path

import numpy as np

import postproc as pp

TCP, ORIGIN, FEED = np.array([150.0, 0.0, 250.0]), np.array([1500.0, -100.0, 700.0]), 0.01
TOP = -0.01
"""The plate's upper side is z = 0 [mm]; a tool point below this is in contact."""
CELL = f"""schema = "postproc.cell/1"
name = "plate"
[robot]
model = "kuka_kr210_r2700_2"
[tool]
frame = {{ xyz_mm = {TCP.tolist()}, abc_deg = [0, 0, 0] }}
axis = "+x"
cutter = {{ diameter_mm = 12, length_mm = 110 }}
[workpiece]
frame = {{ xyz_mm = {ORIGIN.tolist()}, abc_deg = [0, 0, 0] }}
%s[optimize]
step_deg = 60
refine = false
[motion]
%s[process]
spindle = "hand"
"""
MESH = "meshes = [{ box = { size_mm = [360, 360, 120] }, xyz_mm = [100, 100, -60] }]\n"
HOME = "home_deg = [0, -90, 90, 0, 45, 0]\n"
_NUMBERS = re.compile(r"(?<![A-Z])([XYZ]|A[1-6]) ([-\d.]+)")


def about(axis, degrees, x=0.0, y=0.0, z=0.0):
    """A turn by KUKA's sign about an axis, then a shift in the turned frame."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i], T[j, j], T[i, j], T[j, i] = c, c, -s, s
    return T @ np.block([[np.eye(3), np.array([[x], [y], [z]])], [np.zeros(3), 1.0]])


def tip(a):
    """The tool point of a KR 210 R2700-2 in the plate's coordinates [mm], from its machine data."""
    T = about("z", 0.0, z=645.0) @ about("z", -a[0], 330.0) @ about("y", a[1], 1150.0)
    T = T @ about("y", a[2], 1220.0, 0.0, 115.0) @ about("x", -a[3]) @ about("y", a[4])
    T = T @ about("x", -a[5], 215.0) @ about("y", 90.0)
    return (T @ np.append(TCP, 1.0))[:3] - ORIGIN


def faults(text):
    """What a program does that brings the tool into the plate, or out of it, other than by feed."""
    at, joints, speed, found = None, None, None, []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("$VEL.CP="):
            speed = float(line[8:])
        if not line.startswith(("PTP", "LIN", "CIRC")):
            continue
        values = {name: float(value) for name, value in _NUMBERS.findall(line.split(";")[0])}
        if line.startswith("PTP"):
            goal = np.array([values[f"A{k}"] for k in range(1, 7)])
            start = goal if joints is None else joints
            ways = [tip(start + s * (goal - start)) for s in np.linspace(0.0, 1.0, 60)]
            if at is not None and at[2] < TOP:
                found.append((number, "begins in contact", at.tolist()))
            over = [p for p in ways if (np.abs(p[:2] - 100.0) < 180.0).all()]
            if any(p[2] < TOP for p in [ways[-1], *over]):
                found.append((number, "comes into contact", ways[-1].tolist()))
            at, joints = ways[-1], goal
            continue
        goal = np.array([values[k] for k in "XYZ"])
        joints = None  # the next joint motion is judged by both ends and above the plate
        straight_up = np.abs(goal - at)[:2].max() < 0.01 and goal[2] > at[2]
        if min(at[2], goal[2]) < TOP and speed > 1.01 * FEED and not straight_up:
            found.append((number, "rapid in contact", goal.tolist()))
        at = goal
    if at[2] < TOP:
        found.append((number, "ends in contact", at.tolist()))
    return found


def cut(seed):
    """A file whose cut is broken in the middle, once or twice, by points that no arm reaches."""
    rng = np.random.default_rng(seed)
    is_led = bool(rng.integers(0, 3))
    depth, clear = rng.uniform(1.0, 90.0 if is_led else 45.0), rng.uniform(5.0, 80.0)
    count = int(rng.integers(6, 14))
    points = np.column_stack([rng.uniform(0.0, 200.0, (count, 2)), np.full(count, -depth)])
    points[:, 2] += rng.uniform(0.0, 0.9 * depth, count) * rng.integers(0, 2)
    for first in rng.choice(np.arange(2, count - 2), rng.integers(1, 3), replace=False):
        far = rng.uniform(3000.0, 6000.0) * np.array([1.0, rng.uniform(-1, 1), 0.0])
        points[first : first + rng.integers(1, 3)] += far
    x, y = points[0, :2]
    ends = "RAPID\nGOTO/{:.3f},{:.3f},{:.3f}\n".format(*points[-1, :2], clear)
    lines = "".join("GOTO/{:.3f},{:.3f},{:.3f}\n".format(*p) for p in points)
    lead = f"RAPID\nGOTO/{x:.3f},{y:.3f},{clear:.3f},0,0,1\n"
    return (
        f"UNITS/MM\n{lead * is_led}FEDRAT/600,MMPM\n{lines}"
        f"{ends if rng.integers(0, 2) else ''}FINI\n"
    )


def judged(seed, mesh, home):
    """Faults of the program of a cut, None where none was written."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cell.toml").write_text(CELL % (MESH if mesh else "", HOME if home else ""))
        (folder / "part.apt").write_text(cut(seed))
        cell = pp.load_cell(folder / "cell.toml")
        job = pp.convert(pp.read(folder / "part.apt", cell), cell, partial=True)
    text = "".join(data.decode() for file, data in job.files.items() if file.endswith(".src"))
    return faults(text) if text else None


def test_random_cuts_with_unreachable_points_in_the_middle():
    wrong, written, tried = [], 0, 0
    for seed, mesh in itertools.product(range(0, 50, 6), (False, True)):
        found = judged(seed, mesh, home=bool(seed % 4))
        tried += 1
        written += found is not None
        wrong += [(seed, mesh, *fault) for fault in found or ()]
    assert not wrong
    assert written > 0.7 * tried


def test_the_judge_sees_what_it_is_for():
    """The program that dived: from above straight into uncut material by the axes, and back."""
    q = "A1 2.45,A2 -103.165,A3 153.437,A4 0,A5 -50.271,A6 0"
    down = tip(np.array([2.45, -103.165, 153.437, 0.0, -50.271, 0.0]))
    above = f"LIN {{X {down[0]:.3f},Y {down[1]:.3f},Z 40.0,A 0,B 90,C 0}}"
    deep = "A1 2.45,A2 -96.0,A3 153.437,A4 0,A5 -57.4,A6 0"
    text = f"PTP {{{q}}}\n$VEL.CP=1.0\n{above}\nPTP {{{deep}}}\nPTP {{{q}}}\n"
    down, begins, back = (what for _, what, _ in faults(text))
    assert (down, begins, back) == ("comes into contact", "begins in contact", "comes into contact")
