"""Rows that name their tool are simulated with that tool of the cell."""

from __future__ import annotations

import json

import numpy as np

from postproc.cli.app import run
from tools.blind.campaign import Plan, drive
from tools.blind.chain import Geometry, embed, sweep, torques
from tools.blind.robots import KR210, cell_text
from tools.blind.world import TOOL_BODY

TCP_MM = {1: (50.0, -40.0, 280.0), 2: (-120.0, 30.0, 410.0), 3: (0.0, 0.0, 150.0)}
MODEL = """schema = "postproc.model/1"
[effects.joint_compliance]
stiffness_Nmm_per_rad = [6.2e9, 4.1e9, 3.0e9, 3.1e8, 2.6e8, 2.0e8]
"""


def cell_of_three() -> str:
    tools = "".join(
        f'[[tools]]\nnumber = {k}\nname = "tool {k}"\naxis = "+z"\nmass_kg = 60.0\n'
        f"frame = {{ xyz_mm = {list(tcp)}, abc_deg = [0, 0, 0] }}\n\n"
        for k, tcp in TCP_MM.items()
    )
    text = cell_text(KR210, None)
    return text[: text.index("[tool]")] + tools + text[text.index("[workpiece]") :]


def test_each_row_has_its_own_tool(tmp_path, capsys) -> None:
    """Point and load of the tool named, by screws; a number that no tool has is the first one."""
    rng = np.random.default_rng(9)
    rows = drive(KR210, Plan("wide_loads", 40, "three", 1.0, False, 0, False, 4.0), rng)
    number = rng.choice([1, 2, 3, 9], 40)
    tool = 1e-3 * np.array([TCP_MM.get(int(k), TCP_MM[1]) for k in number])
    give = np.zeros(14)
    give[[2, 3, 7, 11, 12, 13]] = 1e3 / np.array([6.2e9, 4.1e9, 3.0e9, 3.1e8, 2.6e8, 2.0e8])
    theta, given = embed(rows.q), np.zeros((40, 14))
    for _ in range(30):
        poses = sweep(Geometry.of(KR210.arm, 40), theta + given)
        at = poses.tool_point(tool)
        given = give * torques(poses, TOOL_BODY, at, rows.force)
    head = "id," + ",".join(f"q{k}_deg" for k in range(1, 7)) + ",x_mm,y_mm,z_mm,fx_N,fy_N,fz_N"
    lines = [f"{head},tool_no"]
    for k in range(40):
        numbers = (*np.rad2deg(rows.q[k]), *(1e3 * at[k]), *rows.force[k])
        lines.append(f"r{k}," + ",".join(f"{v:.9f}" for v in numbers) + f",{number[k]}")
    (tmp_path / "rows.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "cell.toml").write_text(cell_of_three(), encoding="utf-8")
    (tmp_path / "model.toml").write_text(MODEL, encoding="utf-8")
    call = ["predict", str(tmp_path / "rows.csv"), "--cell", str(tmp_path / "cell.toml")]
    call += [
        "--tool",
        "1",
        "--model",
        str(tmp_path / "model.toml"),
        "-o",
        str(tmp_path / "out.csv"),
        "--json",
    ]
    assert run(call) == 0
    assert json.loads(capsys.readouterr().out)["rms_mm"] < 1e-4
