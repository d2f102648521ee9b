"""Jobs that are good, broken by one thing at a time; what broke them is known.

A drilled panel on its table, flat or upright, drilled by a straight or an angled spindle of one of
three arms, with a post and a rack about; or the same panel milled around, from a rail, or by two
tools. ``broken`` changes one number of it.
"""

import re
import sys
import tempfile
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from postproc.cell import edited_cell, load_cell, load_robot
from postproc.errors import PostprocError
from postproc.geometry import transform_from_kuka
from postproc.jobs.convert import ConvertRequest, convert, explained, read_toolpath
from postproc.records import dataclass

KINDS = {
    "far": "out of the arm's reach",
    "high": "out of the arm's reach",
    "margin": "joint_margin_deg",
    "limits": r"lets A\d turn",
    "singular": "singularity_deg",
    "fixture": "'(lid|post|rack|table)' is in the way",
    "part": "'rib' of the part",
    "tool": "'guard' of tool 1 hits",
    "clearance": "clearance_mm",
    "inch": "read in inch",
    "metres": "written in m",
    "axis": "the axis of tool 1 is",
    "side": "wrong side",
    "pin": "pin",
}
"""What is broken, and words of the sentence that names it."""
WORKS = ("drill", "mill", "rail", "tools")
ROBOTS = ("kuka_kr500_r2830", "kuka_kr600_r2830", "kuka_kr210_r2700_2")


@dataclass(frozen=True)
class Draw:
    """What a job is made of; places in mm and deg, the panel's middle in ``at``."""

    robot: str
    straight: bool
    at: tuple
    abc: tuple
    home: tuple
    points: np.ndarray
    limits: str = ""
    robot_keys: str = ""
    axis: str = ""
    tables: str = ""
    part: str = ""
    tool: str = ""
    unit: str = "mm"
    frame_scale: float = 1.0
    pins: str = ""
    work: str = "drill"

    @property
    def reach(self):
        return 420.0 if self.straight else 362.0

    def text(self):
        T = transform_from_kuka(*self.home)  # where all else stands as it did
        table = T @ transform_from_kuka([0, 0, -90], [0, 0, 0])
        x, y = T[:2, 3] * 1e3
        tcp, axis = ([0, 0, 420], "+z") if self.straight else ([107, 0, 362], "+x")
        place = (
            "xyz_mm = [0, 0, 170]"
            if self.straight
            else "xyz_mm = [-60, 0, 362], abc_deg = [0, 90, 0]"
        )
        frame = [round(float(v) * self.frame_scale, 9) for v in self.at]
        where = np.round(table[:3, 3] * 1e3, 3).tolist()
        tool = f"""frame = {{ xyz_mm = {tcp} }}
axis = "{self.axis or axis}"
cutter = {{ diameter_mm = 10, length_mm = 100 }}
meshes = [
    {{ name = "spindle", cylinder = {{ radius_mm = 60, length_mm = 130 }}, {place} }}{self.tool}
]
"""
        tools = f"[tool]\nnumber = 1\n{tool}"
        if self.work == "tools":  # the other one is as it was
            other = replace(self, work="drill", axis="", tool="").text()
            other = other[
                other.index("[tool]") + len("[tool]\nnumber = 1\n") : other.index("[work")
            ]
            one, two = (f'[[tools]]\nnumber = {n}\ncam = ["{n}"]\n' for n in (1, 2))
            tools = f"{one}{tool}{two}{other}"
        rail = ""
        if self.work == "rail":
            rail = '[[external_axes]]\nname = "E1"\nkind = "rail"\naxis = "+y"\n'
            rail += "range_mm = [-600, 600]\nspeed_mm_s = 1000\n"
        return f"""\
schema = "postproc.cell/1"
name = "broken"
[robot]
model = "{self.robot}"
{self.robot_keys}
{tools}[workpiece]
number = 1
frame = {{ xyz_mm = {frame}, abc_deg = {list(self.abc)} }}
meshes = [
    {{ name = "panel", box = {{ size_mm = [500, 400, 20] }}, xyz_mm = [0, 0, -10] }}{self.part}
]
[[obstacles]]
name = "table"
box = {{ size_mm = [400, 300, 100] }}
xyz_mm = {where}
abc_deg = {list(self.home[1])}
[[obstacles]]
name = "post"
box = {{ size_mm = [150, 150, 1200] }}
xyz_mm = [{x:.1f}, {y + 1300:.1f}, 600]
[[obstacles]]
name = "rack"
box = {{ size_mm = [300, 300, 900] }}
xyz_mm = [{x + 500:.1f}, {y - 1300:.1f}, 450]
{self.tables}
[limits]
{self.limits}
[process]
spindle = "unit"
[motion]
feed_mm_min = 300
[import]
units = "{self.unit}"
{self.pins}{rail}"""

    def write(self, folder: Path):
        """Write the input; return its path."""
        if self.work == "mill":
            x, y = np.abs(self.points[:, :2]).max(axis=0) + 20.0
            corners = [(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
            goto = [f"GOTO/{a:g},{b:g},0,0,0,1" for a, b in corners]
            head = ["PARTNO/P", "UNITS/MM", "MULTAX", "RAPID", f"GOTO/{-x:g},{-y:g},60,0,0,1"]
            lines = [
                *head,
                "FEDRAT/600,MMPM",
                *goto,
                "RAPID",
                f"GOTO/{-x:g},{-y:g},60,0,0,1",
                "FINI",
            ]
            (folder / "part.apt").write_text("\n".join(lines) + "\n")
            return folder / "part.apt"
        several = self.work == "tools"
        rows = "\n".join(
            f"H{k},{x:g},{y:g},{z:g},0,0,1,8{f',{1 + k % 2}' if several else ''}"
            for k, (x, y, z) in enumerate(self.points)
        )
        head = "id,x,y,z,i,j,k,depth" + (",tool" if several else "")
        (folder / "holes.csv").write_text(f"{head}\n{rows}\n")
        return folder / "holes.csv"


def drawn(rng):
    """Return a job that may be good."""
    n = int(rng.integers(3, 8))
    flat = bool(rng.random() < 0.6)
    points = rng.uniform(-150, 150, (n, 3)) * [1, 0.8, 0]
    radius, angle = rng.uniform(1500, 2000), rng.uniform(-0.6, 0.6)
    at = (
        radius * np.cos(angle),
        radius * np.sin(angle),
        rng.uniform(400, 900) + (0 if flat else 300),
    )
    abc = (
        float(rng.integers(-180, 180)) if flat else float(np.degrees(angle).round()),
        0.0 if flat else -90.0,
        0.0,
    )
    at = tuple(round(float(v)) for v in at)
    return Draw(
        str(rng.choice(ROBOTS)), bool(rng.random() < 0.5), at, abc, (at, abc), np.round(points, 3)
    )


def changed(draw, kind, rng):
    """Return the job with one thing broken."""
    T = transform_from_kuka(draw.at, draw.abc)
    up = T[:3, 2]
    at = np.array(draw.at, float)
    if kind == "far":
        far = rng.uniform(3300, 4300) / np.hypot(*at[:2])
        return replace(draw, at=(round(at[0] * far), round(at[1] * far), draw.at[2]))
    if kind == "high":
        return replace(draw, at=(draw.at[0], draw.at[1], int(rng.integers(3300, 4200))))
    if kind == "margin":
        return replace(draw, limits=f"joint_margin_deg = {rng.integers(50, 85)}")
    if kind == "limits":
        axis = int(rng.integers(0, 6))
        low = int(rng.integers(-100, 60))
        wide = load_limits(draw.robot)
        low = max(low, int(wide[axis][0]))
        wide[axis] = [low, low + 12]
        if rng.random() < 0.5:
            return replace(draw, robot_keys=f"cable = {{ A{axis + 1} = {wide[axis]} }}")
        return replace(draw, robot_keys=f"limits_deg = {wide}")
    if kind == "singular":
        return replace(draw, limits=f"singularity_deg = {rng.integers(70, 89)}")
    if kind == "clearance":
        lid = _box("beam", at + 330.0 * up, [100, 400, 100], draw.abc)
        return replace(draw, limits=f"clearance_mm = {rng.integers(150, 350)}", tables=lid)
    if kind == "fixture":
        lid = _box(
            "lid", at + rng.uniform(20, 80) * up, [500, 500, int(rng.integers(10, 60))], draw.abc
        )
        return replace(draw, tables=lid)
    if kind == "part":  # a wall around the holes that the spindle does not get past
        height = int(rng.integers(130, 260))
        rib = (
            f', {{ name = "rib", box = {{ size_mm = [500, 400, {height}] }}, '
            f"xyz_mm = [0, {int(rng.integers(0, 60))}, {height // 2 + 20}] }}"
        )
        return replace(draw, part=rib)
    if kind == "tool":
        place = "[0, 0, 400]" if draw.straight else "[90, 0, 362], abc_deg = [0, 90, 0]"
        guard = (
            f', {{ name = "guard", cylinder = {{ radius_mm = {rng.integers(40, 90)}, '
            f"length_mm = {rng.integers(60, 100)} }}, xyz_mm = {place} }}"
        )
        return replace(draw, tool=guard)
    if kind == "inch":
        return replace(draw, unit="inch")
    if kind == "metres":
        return replace(draw, frame_scale=1e-3)
    if kind == "axis":
        return replace(draw, axis=str(rng.choice(["-z", "-z", "+x"])) if draw.straight else "-x")
    if kind == "side":
        return replace(draw, abc=(draw.abc[0] + 180.0, *draw.abc[1:]))
    return replace(draw, pins=f"[optimize]\npins = {{ H0 = {rng.integers(-180, 180)} }}\n")


def load_limits(robot):
    """Return the limits of an arm [deg]."""
    found = load_robot(robot)
    return np.degrees(np.column_stack([found.q_min, found.q_max])).round(6).tolist()


def converted(draw, folder: Path):
    """Write the files of a job and convert it; None where it is refused before it is planned."""
    source = draw.write(folder)
    (folder / "cell.toml").write_text(draw.text())
    try:
        cell = load_cell(folder / "cell.toml")
        request = ConvertRequest(str(source), str(folder / "cell.toml"))
        return convert(request, None, read_toolpath(request, cell), cell)
    except PostprocError:
        return None


def broken(kind, seed, folder: Path, work="drill", most=30):
    """Return the draw and the broken conversion of it; draws that break nothing are passed over."""
    rng = np.random.default_rng([sorted(KINDS).index(kind), seed])
    for _ in range(most):
        draw = replace(drawn(rng), work=work)
        if kind == "side" and draw.abc[1] == 0.0:
            continue
        done = converted(draw, folder)
        if done is None or not done.good:
            continue
        bad = changed(draw, kind, rng)
        done = converted(bad, folder)
        if done is not None and not done.good and done.plan.errors:
            return bad, done
    return None


def _box(name, at, size, abc):
    return (
        f'[[obstacles]]\nname = "{name}"\nbox = {{ size_mm = {size} }}\n'
        f"xyz_mm = {[round(float(v), 1) for v in at]}\nabc_deg = {list(abc)}\n"
    )


def named(kind, text):
    """Return whether a sentence names what was broken."""
    return re.search(KINDS[kind], text) is not None


def cured(draw, done, cause, folder):
    """Do what a cause says, by the keys that it names, and return whether the job is good."""
    if cause.changes:
        content = edited_cell(done.cell, cause.changes, folder / "cured.toml")
        (folder / "cured.toml").write_bytes(content)
    else:  # pins are taken off by hand
        (folder / "cured.toml").write_text(replace(draw, pins="").text())
    return convert(ConvertRequest(done.toolpath.path, str(folder / "cured.toml"))).good


def told(kind, seed, folder, work="drill"):
    """Return the first cause of a broken job, and what is wrong with it; None where not drawn."""
    found = broken(kind, seed, folder, work)
    if found is None:
        return None
    draw, done = found
    request = ConvertRequest(done.toolpath.path, done.cell.path)
    first = explained(done, request).causes[0]
    wrong = [] if named(kind, first.text) else ["not named"]
    wrong += [] if first.proven and cured(draw, done, first, folder) else ["not cured"]
    return first, wrong


def main(kinds, seeds, works=("drill",)):
    """Tell what is said of broken jobs: ``python -m tests.jobs.broken KINDS SEEDS WORKS``."""
    right = count = 0
    for kind in kinds:
        for seed, work in product(seeds, works):
            with tempfile.TemporaryDirectory() as folder:
                start = time.process_time()
                found = told(kind, seed, Path(folder), work)
            if found is None:
                sys.stdout.write(f"{kind} {work} {seed} not drawn\n")
                continue
            count, right = count + 1, right + (not found[1])
            took = f"{time.process_time() - start:.1f} s"
            line = (
                f"{kind} {work} {seed} {took} {' and '.join(found[1]) or 'right'} {found[0].text}\n"
            )
            sys.stdout.write(line)
            sys.stdout.flush()
    sys.stdout.write(f"{right} of {count} named and cured\n")


if __name__ == "__main__":
    main(
        list(KINDS) if sys.argv[1:2] in ([], ["all"]) else sys.argv[1].split(","),
        [int(seed) for seed in (sys.argv[2] if len(sys.argv) > 2 else "0,1,2,3").split(",")],
        (sys.argv[3] if len(sys.argv) > 3 else "drill").split(","),
    )
