"""Random crowded cells and what is to be done in them, as files that a user would write."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.geometry import abc_from_rotation, rotation_from_vector
from postproc.units import DEG, MM

ROBOTS = {
    "kuka_kr500_r2830": (1.7, 0.9),
    "kuka_kr210_r2700_prime": (1.6, 0.9),
    "kuka_kr120_r2700_2": (1.6, 0.9),
}
"""Built-in arms, and where the part stands: distance and height [m]."""
SPEED = (
    "speed_deg_s = [100, 90, 90, 120, 110, 180]\naccel_deg_s2 = [200, 200, 200, 300, 300, 400]\n"
)


HOMES = tuple(
    f"[{a1}, {a2}, {-a2}, 0, {a5}, 0]"
    for a2, a5 in ((-100, 20), (-110, 60), (-125, 30))
    for a1 in (0, 60, -60, 120, -120, 170)
)
"""Poses [deg] to begin and end in; the first stands in the cell file, a user takes a free one."""
STYLES = ("dense", "spline", "spline_block")
"""How path motions are written where the rail moves with them: LIN and CIRC, or splines."""
_SLOTS = 0.4
"""Share of slots among what is to be done."""
_MILLED = 12
"""Cuts along a rail to choose from, each longer than the arm reaches from one place of it."""


@dataclass(frozen=True, slots=True)
class Job:
    """A cell file and a CAM file in APT."""

    cell: str
    blocks: tuple[str, ...]

    def cam(self, keep: BoolArray) -> str:
        """Return the CAM file with the blocks to keep (b,); four lines stand ahead of them."""
        head = "PARTNO/CROWDED\nUNITS/MM\nMULTAX/ON\nSPINDL/3000,RPM,CLW\n"
        return head + "".join(self.cam_blocks(keep)) + "SPINDL/OFF\nFINI\n"

    def cam_blocks(self, keep: BoolArray) -> list[str]:
        """Return the blocks to keep (b,)."""
        return [block for block, kept in zip(self.blocks, keep, strict=True) if kept]


def random_job(rng: np.random.Generator, tags: int, *, with_rail: bool, along: bool = False) -> Job:
    """Return a crowded cell with holes and slots in a block.

    ``along``: also cuts along the rail, which moves with them; fewer solids are in their way.
    """
    robot = str(rng.choice(list(ROBOTS)))
    far, high = ROBOTS[robot]
    size = np.array([rng.uniform(300, 900), rng.uniform(300, 900), rng.uniform(40, 200)])
    if with_rail:
        size[1] = rng.uniform(5500 if along else 3000, 8000)
    turn = rotation_from_vector(rng.uniform(-0.15, 0.15, 3))
    place = np.array([far, 0.0, high]) + rng.uniform(-0.15, 0.15, 3)
    blend = float(np.exp(rng.uniform(np.log(0.5), np.log(300.0))))
    text = [
        'schema = "postproc.cell/1"\nname = "crowded"\n',
        f'[robot]\nmodel = "{robot}"\n{SPEED}',
        _tool(rng),
        f"[workpiece]\nframe = {_frame(place / MM, turn)}\n",
        f"meshes = [{{ box = {{ size_mm = {_list(size)} }}, "
        f"xyz_mm = {_list([0, 0, -0.5 * size[2]])} }}]\n",
        f"[motion]\napproximation_mm = {blend:.3f}\n",
        f"corner_tolerance_mm = {rng.choice([0.2, 1.0, 5.0])}\n",
        f"approach_mm = {rng.choice([20.0, 50.0])}\nhome_deg = {HOMES[0]}\n",
        "[optimize]\nstep_deg = 30\n",
    ]
    if with_rail:
        rail = 'name = "E1"\nkind = "rail"\naxis = "+y"\n'
        text.append(f"[[external_axes]]\n{rail}range_mm = [-4500, 4500]\nspeed_mm_s = 1000\n")
    text += _obstacles(rng, place, turn, size, 6 if along else 9)
    if with_rail:
        count = int(rng.integers(2, 7))
        text += [_beside_the_rail(rng, number, along=along) for number in range(count)]
    blocks = _blocks(rng, size, tags, with_rail=with_rail)
    cuts = [_along(rng, size) for _ in range(_MILLED if along else 0)]
    if along:
        text.append(f'[krl]\nmax_points_per_file = 100000\nmotion = "{rng.choice(STYLES)}"\n')
    else:
        text.append("[krl]\nmax_points_per_file = 100000\n")
    return Job("".join(text), (*cuts, *blocks))


def _tool(rng: np.random.Generator) -> str:
    """Return a big head with a cutter, along the flange or across it."""
    wide, deep, tall = rng.uniform([0.08, 0.08, 0.1], [0.25, 0.25, 0.35]) / MM
    length, radius = rng.uniform(50, 150), rng.uniform(2, 10)
    if rng.uniform() < 0.5:
        tcp, axis, at = [0, 0, tall + 20 + length], "+z", [0, 0, 0.5 * tall + 20]
    else:
        tcp = [0.5 * wide + length, 0, tall - 20]
        axis, at = "+x", [0, 0, 0.5 * tall + 20]
    return (
        f"[tool]\nframe = {{ xyz_mm = {_list(tcp)}, abc_deg = [0, 0, 0] }}\n"
        f'axis = "{axis}"\nmass_kg = 60\ncog_mm = [0, 0, 200]\n'
        f"cutter = {{ diameter_mm = {2 * radius:.2f}, length_mm = {length - 1:.2f} }}\n"
        f'meshes = [{{ name = "head", box = {{ size_mm = {_list([wide, deep, tall])} }}, '
        f"xyz_mm = {_list(at)} }}]\n"
    )


def _obstacles(
    rng: np.random.Generator, place: FloatArray, turn: FloatArray, size: FloatArray, most: int
) -> list[str]:
    """Return rods of 2 to 60 mm and blocks round the part, fewer than ``most``.

    They are clear of what is in front of the part.
    """
    found = []
    for number in range(int(rng.integers(3, most))):
        side = rng.uniform(-0.5, 0.5, 2) * size[:2]
        edge = int(rng.integers(2))
        side[edge] = rng.choice([-1.0, 1.0]) * (0.5 * size[edge] + rng.uniform(30.0, 350.0))
        at = place + turn @ (np.r_[side, rng.uniform(-200.0, 500.0)] * MM)
        tilt = rotation_from_vector(rng.uniform(-1.5, 1.5, 3))
        if number % 3 < 2:
            thick = float(np.exp(rng.uniform(np.log(2.0), np.log(60.0))))
            length = rng.uniform(150.0, 900.0)
            if number % 6 == 0:  # a post that stands on the part
                length = 0.4 * length
                side = rng.uniform(-0.5, 0.5, 2) * size[:2]
                tilt, at = turn, place + turn @ (np.r_[side, 0.5 * length] * MM)
            shape = f"cylinder = {{ radius_mm = {0.5 * thick:.3f}, length_mm = {length:.1f} }}"
        else:
            shape = f"box = {{ size_mm = {_list(rng.uniform(40.0, 350.0, 3))} }}"
        found.append(
            f'[[obstacles]]\nname = "solid {number}"\n{shape}\nxyz_mm = {_list(at / MM)}\n'
            f"abc_deg = {_list(abc_from_rotation(tilt) / DEG)}\n"
        )
    return found


def _beside_the_rail(rng: np.random.Generator, number: int, *, along: bool) -> str:
    """Return a rod between robot and part, where the arm passes when it travels.

    ``along``: below or above most of its ways, so that some cuts are free from end to end.
    """
    heights = (300.0, 2800.0) if not along else (0.0, 700.0) if number % 2 else (2500.0, 3300.0)
    at = [rng.uniform(700.0, 1500.0), rng.uniform(-4500.0, 4500.0), rng.uniform(*heights)]
    thick = float(np.exp(rng.uniform(np.log(2.0), np.log(60.0))))
    length = rng.uniform(200.0, 700.0 if along else 1500.0)
    tilt = rng.uniform(-90.0, 90.0, 3)
    return (
        f'[[obstacles]]\nname = "beside {number}"\n'
        f"cylinder = {{ radius_mm = {0.5 * thick:.3f}, length_mm = {length:.1f} }}\n"
        f"xyz_mm = {_list(at)}\nabc_deg = {_list(tilt)}\n"
    )


def _blocks(
    rng: np.random.Generator, size: FloatArray, tags: int, *, with_rail: bool
) -> tuple[str, ...]:
    """Return blocks of a CAM file: holes of a cycle, deep holes, slots; long ones along a rail.

    A hole is a block of its own: one that cannot be drilled leaves the others of its row.
    """
    found: list[str] = []
    while sum(block.count("GOTO/") for block in found) < tags:
        x, y = rng.uniform(-0.42, 0.42, 2) * size[:2]
        kind = rng.uniform()
        if kind < _SLOTS:
            found.append(_slot(rng, x, y, size, 8 if with_rail else 24))
        else:
            rows, most = (2, 5) if with_rail else (3, 8)
            found += _holes(rng, x, y, size, rows, most)
    return tuple(found)


def _holes(
    rng: np.random.Generator, x: float, y: float, size: FloatArray, rows: int, most: int
) -> list[str]:
    """Return holes in a row, or in some rows, drilled at once or by pecks."""
    lean = rng.uniform(-0.2, 0.2, 2)
    axis = np.r_[lean, 1.0] / np.sqrt(1.0 + lean @ lean)
    words = f"FEDTO,{rng.uniform(2, 12):.3f},RTRCTO,{rng.uniform(5, 40):.3f}"
    deep = "DEEP,STEP,4.0000," if rng.uniform() < 0.3 else ""
    head = f"CYCLE/DRILL,{deep}CLEAR,3.0000,{words},MMPM,200.0000\n"
    step, shift = rng.uniform(-40.0, 40.0, (2, 2))
    count = int(rng.integers(1, most + 1))
    found = []
    for number in range(count * int(rng.integers(1, rows + 1))):
        p = np.array([x, y]) + number % count * step + number // count * shift
        if (np.abs(p) < 0.45 * size[:2]).all():
            numbers = [f"{value:.7f}" for value in (*p, 0.0, *axis)]
            found.append(head + "GOTO/" + ",".join(numbers) + "\nCYCLE/OFF\n")
    return found


def _slot(rng: np.random.Generator, x: float, y: float, size: FloatArray, most: int) -> str:
    """Return an open polygon of fewer than ``most`` sides, entered and left from above."""
    points = [np.array([x, y])]
    for _ in range(int(rng.integers(2, most))):
        points.append(_inside(points[-1] + rng.uniform(-90.0, 90.0, 2), size))
    return _milled(rng, points, np.array([0.0, 0.0, 1.0]))


def _along(rng: np.random.Generator, size: FloatArray) -> str:
    """Return a cut from one end of the part to the other, with the tool leant as in all of it."""
    half = 0.5 * min(rng.uniform(4500.0, 7000.0), 0.9 * size[1]) * rng.choice([-1.0, 1.0])
    count = int(rng.integers(6, 40))
    y = np.sort(np.r_[-1.0, rng.uniform(-1.0, 1.0, count - 2), 1.0]) * half
    wander = rng.choice([0.0, 60.0])
    x = rng.uniform(-0.42, 0.2) * size[0] + rng.uniform(-wander, wander, count)
    axis = np.r_[rng.uniform(-0.1, 0.1, 2), 1.0]
    points = [_inside(point, size) for point in np.column_stack([x, y])]
    return _milled(rng, points, axis / np.linalg.norm(axis), rounds=0.4)


def _inside(point: FloatArray, size: FloatArray) -> FloatArray:
    return np.clip(point, -0.45 * size[:2], 0.45 * size[:2])


def _milled(
    rng: np.random.Generator, points: list[FloatArray], axis: FloatArray, rounds: float = 0.0
) -> str:
    """Return points (2,) [mm] milled a little into the part, entered and left along the tool.

    A share ``rounds`` of the ways between them are half circles.
    """
    depth, top = rng.uniform(0.5, 5.0), rng.uniform(15.0, 60.0)

    def goto(point: FloatArray, height: float) -> str:
        p = np.r_[point, 0.0] + height / axis[2] * axis
        return "GOTO/" + ",".join(f"{value:.7f}" for value in (*p, *axis)) + "\n"

    lines = ["RAPID\n", goto(points[0], top), "FEDRAT/300,MMPM\n"]
    lines.append(goto(points[0], -depth))
    for start, end in pairwise(points):
        if rng.uniform() < rounds:
            centre = np.r_[0.5 * (start + end), 0.0] - depth / axis[2] * axis
            numbers = (*centre, 0.0, 0.0, rng.choice([-1.0, 1.0]), np.hypot(*(end - start)) / 2.0)
            lines.append("CIRCLE/" + ",".join(f"{value:.7f}" for value in numbers) + "\n")
        lines.append(goto(end, -depth))
    if rng.uniform() < 0.6:
        lines += ["RAPID\n", goto(points[-1], top)]
    return "".join(lines)


def _frame(xyz_mm: FloatArray, R: FloatArray) -> str:
    return f"{{ xyz_mm = {_list(xyz_mm)}, abc_deg = {_list(abc_from_rotation(R) / DEG)} }}"


def _list(values: FloatArray | list[float]) -> str:
    return "[" + ", ".join(f"{float(value):.5f}" for value in values) + "]"
