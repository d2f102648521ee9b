"""Small solids that hit each other at one moment of a program: none is missed.

A knob on the tool or on a link is put where it meets another on the turning part or in the room, at
a random moment between two poses; a knob on the part meets one in the room. The two are the only
solids of the cell.
"""

import re
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.api import load_cell
from postproc.kinematics import build
from postproc.krl import load_modules
from postproc.verification import verify

TABLE = Path(__file__).parents[2] / "fixtures" / "turntable"
PROGRAM = TABLE / "expected" / "ring.src"
AXIS = np.array([2.2, 0.0, 0.3])
BASE = np.array([2.2, 0.0, 0.5])
HOLDERS = ("tool", 3, 4, 5, 6, "part")


def frame(turn, place):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, place
    return T


def part_at(turned):
    """Return where the part stands when its axis has turned so far [rad]."""
    table = frame(Rotation.from_euler("z", turned).as_matrix(), AXIS)
    return table @ frame(np.eye(3), BASE - AXIS)


def solid(T, size):
    """Return the keys of a box of the cell in its frame."""
    xyz = (T[:3, 3] * 1e3).round(6).tolist()
    abc = Rotation.from_matrix(T[:3, :3]).as_euler("ZYX", degrees=True).round(6).tolist()
    return f"box = {{ size_mm = {size} }}", f"xyz_mm = {xyz}", f"abc_deg = {abc}"


def cell_with(text, solids, folder):
    """Return the cell with these solids alone, named by who holds them: (holder, keys of a box)."""
    text = re.sub(r"\nmeshes = .*", "", text)
    links = "{ link = 0, box = { size_mm = [1, 1, 1] } }"  # instead of the hulls of the arm
    for holder, keys in solids:
        box = f'{{ name = "of the {holder}", {", ".join(keys)} }}'
        if holder == "tool":
            text = text.replace('axis = "+x"', f'axis = "+x"\nmeshes = [{box}]')
        elif holder == "part":
            text = text.replace("[workpiece]", f"[workpiece]\nmeshes = [{box}]")
        elif holder == "room":
            text += '\n[[obstacles]]\nname = "of the room"\n' + "\n".join(keys)
        else:
            links += f", {{ link = {holder}, {box[2:]}"
    text = text.replace("[robot]", f"[robot]\nlink_meshes = [{links}]")
    (folder / "cell.toml").write_text(text)
    return load_cell(folder / "cell.toml")


def missed(count, seed):
    """Return the knobs of so many that nothing was told of."""
    rng, modules = np.random.default_rng(seed), load_modules([str(PROGRAM)])
    text = (TABLE / "cell.toml").read_text()
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bare = cell_with(text, (), folder)
        arm = build(bare.robot)
        paths = verify(modules, "ring", bare, collisions=False).run.paths
        motion, share, q, *_ = paths.in_order()
        turned = paths.curves.external_at(motion, share, paths.external)[:, 0]
        for number in range(count):
            at, part = int(rng.integers(len(q) - 1)), rng.random()
            now = (1.0 - part) * q[at] + part * q[at + 1]
            table = part_at((1.0 - part) * turned[at] + part * turned[at + 1])
            holder = HOLDERS[number % len(HOLDERS)]
            other = "room" if holder == "part" else str(rng.choice(["part", "room"]))
            T = {"tool": arm.fk(now), "part": table}.get(holder)
            T = arm.link_frames(now)[holder] if T is None else T
            own = frame(Rotation.random(random_state=rng).as_matrix(), rng.uniform(-0.3, 0.3, 3))
            meets = (
                T
                @ own
                @ frame(
                    Rotation.random(random_state=rng).as_matrix(), rng.uniform(-0.001, 0.001, 3)
                )
            )
            meets = meets if other == "room" else np.linalg.inv(table) @ meets
            sizes = rng.uniform(5.0, 10.0, (2, 3)).round(3).tolist()
            solids = ((holder, solid(own, sizes[0])), (other, solid(meets, sizes[1])))
            report = verify(modules, "ring", cell_with(text, solids, folder))
            told = [f.message for f in report.violations if f.code == "collision"]
            both = (f"of the {holder}", f"of the {other}")
            if not any(all(name in words for name in both) for words in told):
                found.append((number, holder, other, at))
    return found


def test_no_knob_is_missed():
    assert missed(12, 1) == []
