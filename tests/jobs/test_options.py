"""No dead options: every key of the cell and every option of ``convert`` changes what comes out.

The keys are read from the schema and the options from the command itself, so that a new one
without a case here fails.
"""

from __future__ import annotations

import copy
import functools
import json
import math
import typing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import trimesh
from pydantic import BaseModel

from postproc.cell.file import load_cell
from postproc.cell.schema import CellFile
from postproc.cli import app
from postproc.cli.commands.convert import command
from postproc.errors import PostprocError
from postproc.jobs.check_cell import check_cell
from postproc.jobs.convert import ConvertRequest, convert, document
from postproc.toml.edit import toml_table
from tests.kinematics.urdf_text import heavy_urdf

BASE: dict[str, Any] = {
    "schema": "postproc.cell/1",
    "name": "bench",
    "robot": {"model": "kuka_kr500_r2830"},
    "tool": {
        "number": 1,
        "name": "head",
        "frame": {"xyz_mm": [107.0, 0.0, 362.0], "abc_deg": [0.0, 0.0, 0.0]},
        "axis": "+x",
    },
    "workpiece": {"number": 1, "frame": {"xyz_mm": [1700.0, 0.0, 700.0]}},
    "optimize": {"step_deg": 30.0},
    "stiffness": {"joint_Nmm_per_rad": [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]},
    "motion": {"feed_mm_min": 600.0},
}
INPUTS = {
    "holes.csv": "id,x,y,z,i,j,k,depth\n"
    + "".join(f"H{i},{(37 * i) % 200},{40 * (i % 3)},0,0,0,1,5\n" for i in range(7)),
    "points.csv": "id,x,y,z,i,j,k\n" + "".join(f"P{i},{40 * i},0,0,0,0,1\n" for i in range(4)),
    "mill.apt": """\
PARTNO/MILL
UNITS/MM
LOADTL/1
SPINDL/9000,RPM,CLW
COOLNT/ON
RAPID
GOTO/0,0,80,0,0,1
FEDRAT/600,MMPM
GOTO/0,0,0
GOTO/100,0,0
GOTO/200,20,0
CIRCLE/200,40,0,0,0,1,20
GOTO/200,60,0
GOTO/0,80,5
STOP
OPSTOP
COOLNT/OFF
SPINDL/OFF
RAPID
GOTO/0,0,80
FINI
""",
    "line.apt": "PARTNO/LINE\nUNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,-300,0,0,0,1\n"
    + "".join(f"GOTO/{5 * (i % 2)},{-300 + 50 * i},0\n" for i in range(1, 13))
    + "FINI\n",
    "shifted.apt": "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\nCUTCOM/LEFT\nGOTO/100,0,0\nFINI\n",
    "cycle.apt": "UNITS/MM\nCYCLE/DRILL, 5.0, 3.0, 400.0, MMPM\nGOTO/0,0,0,0,0,1\n"
    "CYCLE/OFF\nFINI\n",
    "tap.apt": "UNITS/MM\nSPINDL/600,RPM,CLW\nRAPID\nGOTO/0,0,50,0,0,1\n"
    "CYCLE/TAP,FEDTO,9,MMPM,600,RAPTO,3\nGOTO/0,0,0\nCYCLE/OFF\nFINI\n",
    "bore.apt": "UNITS/MM\nSPINDL/600,RPM,CLW\nRAPID\nGOTO/0,0,50,0,0,1\n"
    "CYCLE/BORE,FEDTO,9,MMPM,600,RAPTO,3,ORIENT,90\nGOTO/0,0,0\nCYCLE/OFF\nFINI\n",
    "inches.apt": "UNITS/INCH\nFEDRAT/35,MMPM\nGOTO/0,0,0,0,0,1\nGOTO/2,0,0\nFINI\n",
    "long.apt": "PARTNO/LONG\nUNITS/MM\nFEDRAT/3000,MMPM\nGOTO/0,-4800,0,0,0,1\n"
    + "".join(f"GOTO/0,{-4800 + 200 * i},0\n" for i in range(1, 49))
    + "FINI\n",
    "plain.apt": "PARTNO/X\nFEDRAT/600\nGOTO/0,0,0,0,0,1\nGOTO/5,0,0\nFINI\n",
    "tasks.xml": "<OLPData><Resource id='r'>"
    + "".join(
        f"<ActivityList Task='{name}'><Activity ActivityType='DNBRobotMotionActivity' "
        f"Operation='{name}' id='{x}'><MotionAttributes><MotionType>Linear</MotionType>"
        f"</MotionAttributes><Target><CartesianTarget><Position Units='m' X='0.{x}' Y='0' Z='0'/>"
        "<Orientation Units='deg' Yaw='0' Pitch='90' Roll='0'/></CartesianTarget></Target>"
        "</Activity></ActivityList>"
        for name, x in (("A", 1), ("B", 2))
    )
    + "</Resource></OLPData>",
    "signals.xml": "<OLPData><Resource><ActivityList Task='T'>"
    + "".join(
        f"<Activity ActivityType='DNB{kind}SignalActivity'><{kind}SignalAttributes "
        f"SignalName='{name}' "
        "SignalValue='On' PortNumber='3'/></Activity>"
        for kind, name in (("Set", "GO"), ("Wait", "DONE"))
    )
    + "<Activity ActivityType='DNBRobotMotionActivity' Operation='A'>"
    "<MotionAttributes><MotionType>Joint</MotionType></MotionAttributes>"
    "<Target><CartesianTarget><Position Units='m' X='0.1' Y='0' Z='0'/>"
    "<Orientation Units='deg' Yaw='0' Pitch='90' Roll='0'/></CartesianTarget></Target>"
    "</Activity></ActivityList></Resource></OLPData>",
    "apart.csv": "x,y,z,i,j,k,depth\n0,-4000,0,0,0,1,5\n0,4000,0,0,0,1,5\n",
    "head.nc": "%\nG21 G90 G54 G43.4 H1\nS3000 M3\nG0 X0 Y0 Z30 B0 C0\nG1 Z1 F600\nX40 B10 C5\n"
    "G0 Z30\nM30\n",
    "tools.csv": "x,y,z,i,j,k,depth,tool\n0,0,0,0,0,1,5,1\n40,0,0,0,0,1,5,MILL\n",
    "bases.csv": "x,y,z,i,j,k,depth,base\n0,0,0,0,0,1,5,A\n40,0,0,0,0,1,5,B\n",
    "cutter.apt": "UNITS/MM\nLOADTL/1\nCUTTER/6\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\nGOTO/100,0,0\n"
    "FINI\n",
    "bent.csv": "x,y,z,i,j,k,feed\n"
    + "".join(f"{i},{0.001 * i * i},0,0,{0.00002 * i * i},1,600\n" for i in range(40)),
    "turn.csv": "x,y,z,i,j,k,feed\n"
    + "".join(f"{i},0,0,{0.28 * (i % 2)},0,{1.0 - 0.04 * (i % 2)},6000\n" for i in range(6)),
    "round.csv": "x,y,z,i,j,k,feed\n"
    + "".join(
        f"{1800 * math.cos(0.1 * i) - 1700:.3f},{1800 * math.sin(0.1 * i):.3f},-700,0,0,1,600\n"
        for i in range(18, 46)
    ),
    "two.csv": "x,y,z,i,j,k,feed,operation\n"
    + "".join(f"{30 * i},0,0,0,0,1,600,{'ROUGH' if i < 3 else 'FINE'}\n" for i in range(6)),
}
THIN = {"motion.thin": {"chord_mm": 0.5, "axis_deg": 0.5}}
SMOOTH = {"optimize.strategy": "smooth", "optimize.loss_bound_percent": 100.0}
BLOCK = {"box": {"size_mm": [300.0, 300.0, 300.0]}, "xyz_mm": [1800.0, 40.0, 760.0]}
ROD = {"cylinder": {"radius_mm": 150.0, "length_mm": 300.0}, "xyz_mm": [1800.0, 40.0, 760.0]}
NOSE = {"box": {"size_mm": [120.0, 60.0, 60.0]}, "xyz_mm": [60.0, 0.0, 362.0]}
RAIL = {
    "name": "E1", "kind": "rail", "axis": "+y", "range_mm": [0.0, 500.0], "speed_mm_s": 400.0,
    "xyz_mm": [0.0, 0.0, 0.0], "abc_deg": [0.0, 0.0, 0.0],
}  # fmt: skip
TABLE = {
    "name": "E1", "kind": "positioner", "axis": "+z", "range_deg": [-90.0, 90.0],
    "speed_deg_s": 40.0, "xyz_mm": [1700.0, 0.0, 0.0], "abc_deg": [0.0, 0.0, 0.0],
}  # fmt: skip
FAR = {"workpiece.frame.xyz_mm": [1700.0, 2600.0, 700.0]}
"""Out of reach unless a rail brings the robot there."""
BEHIND = {"workpiece.frame.xyz_mm": [1700.0, 500.0, 700.0], "workpiece.frame.abc_deg": [0.0] * 3}


def solids(
    where: str, solid: dict[str, Any], beside: dict[str, Any], **more: Any
) -> dict[str, Any]:
    """Return the cases of all keys of a solid at a list of the cell that also holds ``beside``."""
    rod = {**beside, where: [{**ROD, "xyz_mm": solid["xyz_mm"], **more}]}
    x, y, z = solid["xyz_mm"]
    long = {**beside, where: [{**ROD, "xyz_mm": [x, y, z + 900.0], **more}]}
    long |= {f"{where}.0.cylinder.length_mm": 2000.0}
    mesh = {**beside, where: [{"file": "cube.stl", "xyz_mm": solid["xyz_mm"], **more}]}
    here = {**beside, where: [{**solid, **more}]}
    key, bar = f"{where}[]", {**here, f"{where}.0.box.size_mm": [2.0, 600.0, 2.0]}
    return {
        f"{key}.xyz_mm": (here, {f"{where}.0.xyz_mm": [0.0, 0.0, 5000.0]}),
        f"{key}.abc_deg": (bar, {f"{where}.0.abc_deg": [45.0, 0.0, 45.0]}),
        f"{key}.name": (here, {f"{where}.0.name": "named"}),
        f"{key}.file": (beside, mesh),
        f"{key}.scale": (mesh, {f"{where}.0.scale": 0.01}),
        f"{key}.box.size_mm": (here, {f"{where}.0.box.size_mm": [1.0, 1.0, 1.0]}),
        f"{key}.cylinder.radius_mm": (rod, {f"{where}.0.cylinder.radius_mm": 1.0}),
        f"{key}.cylinder.length_mm": (long, {f"{where}.0.cylinder.length_mm": 1.0}),
    }


MODEL = """\
schema = "postproc.model/1"
[effects.joint_compliance]
stiffness_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
"""
URDF = """\
<robot name="arm"><link name="base"/>{links}<link name="plate"/>
<joint name="end" type="fixed"><parent link="l6"/><child link="plate"/><origin xyz="0 0 0.05"/>
</joint></robot>
"""
LINK = """\
<joint name="j{i}" type="revolute"><parent link="{a}"/><child link="l{i}"/>
<origin xyz="{xyz}" rpy="0 0 0"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="1" velocity="2"/></joint><link name="l{i}"/>
"""
CHAIN = (
    ("0 0 1", "0 0 0.4"), ("0 1 0", "0.5 0 0.6"), ("0 1 0", "0 0 1.3"),
    ("1 0 0", "1.0 0 0"), ("0 1 0", "0 0 0"), ("1 0 0", "0.3 0 0"),
)  # fmt: skip


def urdf() -> str:
    """Return an arm of the size of the built-in ones."""
    names = ["base", *(f"l{i}" for i in range(1, 7))]
    links = [
        LINK.format(i=i + 1, a=names[i], axis=axis, xyz=xyz) for i, (axis, xyz) in enumerate(CHAIN)
    ]
    return URDF.format(links="".join(links))


TUNED = (
    Path(__file__).parents[2] / "templates/default/motion_speeds.j2"
).read_text() + "$OV_PRO=50\n"

MILL, HOLES, LINE = "mill.apt", "holes.csv", "line.apt"
DIP = {
    "tool.meshes": [
        {"box": {"size_mm": [40.0] * 3}, "xyz_mm": [107.0, 0.0, 362.0], "cutting": True}
    ],
    "workpiece.meshes": [
        {"box": {"size_mm": [400.0, 400.0, 100.0]}, "xyz_mm": [100.0, 40.0, -50.0]}
    ],
}
"""A tool that goes 20 mm into the part at its tip."""
HEAD = {"tool.meshes": [NOSE]}
ROOF = {"box": {"size_mm": [20.0, 20.0, 20.0]}, "xyz_mm": [1700.0, 0.0, 850.0]}
LONG = "long form"
"""Stands for a key: tool and workpiece become the first of tools, before these, and of bases."""
ABOVE = {**BLOCK, "xyz_mm": [1800.0, 40.0, 930.0]}
WRIST_AT = {"xyz_mm": [652.0, 0.0, -60.0]}
WRIST = {**NOSE, **WRIST_AT}
CHECK = "check"
"""Stands for an input: the cell is checked, nothing is converted."""
SETUP = {"krl.setup": True, "tool.mass_kg": 50.0, "tool.cog_mm": [0.0, 0.0, 100.0]}
FORCE = {"process.force_N": [-500.0, 0.0, 0.0]}
WITH_MODEL = {"model": "model.toml"}
KR500_MM = {
    "a1": 500.0,
    "a2": 55.0,
    "b": 0.0,
    "c1": 1045.0,
    "c2": 1300.0,
    "c3": 1025.0,
    "c4": 290.0,
}
OWN_ARM = {
    "dimensions_mm": KR500_MM,
    "limits_deg": [[-180.0, 180.0], [-130.0, 20.0], [-100.0, 144.0]] + [[-120.0, 120.0]] * 3,
    "speed_deg_s": [90.0] * 6,
}
HOOKS = {"spindle_on", "spindle_off", "coolant_on", "coolant_off", "stop", "optional_stop"}
OPERATIONS = {
    "process.operations": [
        {"name": "ROUGH", "force_N": [-500.0, 0.0, 0.0], "moment_Nm": [0.0, 0.0, 0.0]}
    ]
}
KEEP = {"keep": "old.src"}
CASES: dict[str, tuple[Any, ...]] = {
    "schema": ({}, {"schema": "postproc.cell/2"}),
    "name": ({}, {"name": "other"}, CHECK),
    "robot.model": ({}, {"robot.model": "kuka_kr240_r2900_2"}),
    "robot.urdf": ({}, {"robot": {"urdf": "arm.urdf"}}),
    "robot.tip": ({"robot": {"urdf": "arm.urdf"}}, {"robot.tip": "l6"}),
    **{
        f"robot.dimensions_mm.{key}": (
            {"robot.dimensions_mm": KR500_MM},
            {f"robot.dimensions_mm.{key}": KR500_MM[key] + 1.0},
        )
        for key in KR500_MM
    },
    "robot.solids": ({}, {"robot.solids": "simple"}, CHECK),
    "robot.name": ({"robot": OWN_ARM}, {"robot.name": "other"}, CHECK),
    "robot.base.xyz_mm": (
        {"obstacles": [BLOCK], **HEAD},
        {"robot.base": {"xyz_mm": [0.0, 0.0, 3000.0]}},
    ),
    "robot.base.abc_deg": (
        {"obstacles": [BLOCK], **HEAD},
        {"robot.base": {"abc_deg": [90.0, 0.0, 0.0]}},
    ),
    "robot.limits_deg": ({}, {"robot.limits_deg": [[-5.0, 5.0]] + [[-120.0, 120.0]] * 5}),
    "robot.speed_deg_s": ({}, {"robot.speed_deg_s": [1.0] * 6}),
    "robot.accel_deg_s2": ({}, {"robot.accel_deg_s2": [1.0] * 6}),
    "robot.jerk_deg_s3": ({}, {"robot.jerk_deg_s3": [10.0] * 6}),
    "robot.torque_nm": ({"robot": {"urdf": "heavy.urdf"}}, {"robot.torque_nm": [3500.0] * 6}),
    "robot.cable": ({}, {"robot.cable": {"A5": [-40.0, 40.0]}}),
    "robot.payload_kg": ({"tool.mass_kg": 50.0}, {"robot.payload_kg": 20.0}, CHECK),
    **solids("robot.link_meshes", WRIST, {"obstacles": [ABOVE]}, link=6),
    "robot.link_meshes[].link": (
        {"robot.link_meshes": [{**WRIST, "link": 6}], "obstacles": [ABOVE]},
        {"robot.link_meshes.0.link": 0},
    ),
    "tool.number": ({}, {"tool.number": 7}),
    "tool.name": (SETUP, {"tool.name": "other"}),
    "tool.frame.xyz_mm": ({}, {"tool.frame.xyz_mm": [107.0, 0.0, 300.0]}),
    "tool.frame.abc_deg": ({}, {"tool.frame.abc_deg": [0.0, 20.0, 0.0]}),
    "tool.axis": ({}, {"tool.axis": "+z"}),
    "tool.mass_kg": (SETUP, {"tool.mass_kg": 60.0}),
    "tool.cog_mm": (SETUP, {"tool.cog_mm": [0.0, 0.0, 150.0]}),
    **solids("tool.meshes", NOSE, {"obstacles": [ABOVE]}),
    "tool.meshes[].cutting": (DIP, {"tool.meshes.0.cutting": False}, MILL),
    "tool.spindle": ({}, {"tool.spindle": "ccw"}, MILL),
    "tool.cam": ({"tool.cam": ["1"]}, {"tool.cam": ["1", "MILL"]}, "tools.csv"),
    "tool.inertia_kg_m2": (SETUP, {"tool.inertia_kg_m2": [1.0, 2.0, 3.0]}),
    "tool.cutter.diameter_mm": (
        {"tool.cutter": {"diameter_mm": 6.0, "length_mm": 50.0}},
        {"tool.cutter.diameter_mm": 8.0},
        "cutter.apt",
    ),
    "tool.cutter.length_mm": (
        {"tool.cutter": {"diameter_mm": 6.0, "length_mm": 50.0}, "obstacles": [ROOF]},
        {"tool.cutter.length_mm": 300.0},
    ),
    "workpiece.name": ({}, {"workpiece.name": "table"}, CHECK),
    "workpiece.number": ({}, {"workpiece.number": 3}),
    "workpiece.cam": ({"workpiece.cam": ["A"]}, {"workpiece.cam": ["A", "B"]}, "bases.csv"),
    "workpiece.frame.xyz_mm": ({}, {"workpiece.frame.xyz_mm": [1600.0, 0.0, 700.0]}),
    "workpiece.frame.abc_deg": ({}, {"workpiece.frame.abc_deg": [10.0, 0.0, 0.0]}),
    **solids("workpiece.meshes", {**BLOCK, "xyz_mm": [100.0, 40.0, 60.0]}, HEAD),
    **solids("obstacles", BLOCK, HEAD),
    "process.spindle": ({}, {"process.spindle": "hand"}),
    "process.spindle_rpm": ({}, {"process.spindle_rpm": 3000.0}),
    "motion.path_entry": ({}, {"motion.path_entry": "none"}, LINE),
    "process.feed_by": ({}, {"process.feed_by": "unit"}),
    "process.hole": ({}, {"process.hole": ["clamp", "drill", "unclamp"]}),
    "krl.outputs": ({}, {"krl.outputs": {"GO": 7}}, "signals.xml"),
    "krl.inputs": ({}, {"krl.inputs": {"DONE": 8}}, "signals.xml"),
    "krl.hooks.signal": ({}, {"krl.hooks": {"signal": "SET_IT"}}, "signals.xml"),
    "krl.hooks.wait_signal": ({}, {"krl.hooks": {"wait_signal": "AWAIT_IT"}}, "signals.xml"),
    "limits.joint_margin_deg": ({}, {"limits.joint_margin_deg": 80.0}),
    "limits.singularity_deg": ({}, {"limits.singularity_deg": 80.0}),
    "limits.clearance_mm": (
        {"obstacles": [{**BLOCK, "xyz_mm": [1800.0, 60.0, 540.0]}], **HEAD},
        {"limits.clearance_mm": 500.0},
    ),
    "limits.contact_depth_mm": (DIP, {"limits.contact_depth_mm": 1.0}, MILL),
    "optimize.objective": ({}, {"optimize.objective": "normal"}, LINE),
    "optimize.index": ({}, {"optimize.index": "ellipsoid"}),
    "optimize.step_deg": ({"optimize.refine": False}, {"optimize.step_deg": 7.0}),
    "optimize.range_deg": ({}, {"optimize.range_deg": [10.0, 20.0]}),
    "optimize.strategy": ({}, {"optimize.strategy": "each"}),
    "optimize.preset": ({}, {"optimize.preset": "fastest"}),
    "optimize.turns": ({"optimize.objective": {"travel": 1.0}}, {"optimize.turns": False}),
    "optimize.refine": ({}, {"optimize.refine": False}),
    "optimize.spin_round_deg": ({}, {"optimize.spin_round_deg": 7.0}),
    "optimize.keep_loss_percent": ({}, {"optimize.keep_loss_percent": 50.0}, HOLES, KEEP),
    "optimize.key_every_mm": (SMOOTH, {"optimize.key_every_mm": 1e4}, LINE),
    "optimize.key_corner_deg": (
        {**SMOOTH, "optimize.key_every_mm": 1e4},
        {"optimize.key_corner_deg": 1.0},
        LINE,
    ),
    "optimize.key_tags": (SMOOTH, {"optimize.key_tags": [3]}, LINE),
    "optimize.loss_bound_percent": (
        {**SMOOTH, "optimize.key_every_mm": 1e4},
        {"optimize.loss_bound_percent": 0.0},
        LINE,
    ),
    "optimize.free_order": ({}, {"optimize.free_order": True}),
    "optimize.pins": ({}, {"optimize.pins": {"H3": -12.0}}),
    "optimize.lead_deg": ({}, {"optimize.lead_deg": [0.0, 10.0]}, LINE),
    "optimize.side_tilt_deg": ({}, {"optimize.side_tilt_deg": [0.0, 10.0]}, LINE),
    "optimize.tilt_step_deg": (
        {"optimize.lead_deg": [-10.0, 10.0]},
        {"optimize.tilt_step_deg": 10.0},
        LINE,
    ),
    "process.force_N": ({}, FORCE, HOLES, WITH_MODEL),
    "process.moment_Nm": ({}, {"process.moment_Nm": [0.0, 50.0, 0.0]}, HOLES, WITH_MODEL),
    "process.operations[].name": (
        OPERATIONS,
        {"process.operations.0.name": "FINE"},
        "two.csv",
        WITH_MODEL,
    ),
    "process.operations[].force_N": (
        OPERATIONS,
        {"process.operations.0.force_N": [-50.0, 0.0, 0.0]},
        "two.csv",
        WITH_MODEL,
    ),
    "process.operations[].moment_Nm": (
        OPERATIONS,
        {"process.operations.0.moment_Nm": [0.0, 50.0, 0.0]},
        "two.csv",
        WITH_MODEL,
    ),
    "process.least_feed_percent": ({}, {"process.least_feed_percent": 100.0}, "turn.csv"),
    "stiffness.joint_Nmm_per_rad": (
        {},
        {"stiffness.joint_Nmm_per_rad": [1e10, 1e9, 1e10, 1e8, 1e9, 1e8]},
    ),
    "motion.rapid_percent": ({}, {"motion.rapid_percent": 20.0}),
    "motion.feed_mm_min": ({}, {"motion.feed_mm_min": 300.0}),
    "motion.corner_tolerance_mm": ({}, {"motion.corner_tolerance_mm": 0.05}, MILL),
    "motion.approximation_mm": ({}, {"motion.approximation_mm": 3.0}, MILL),
    "motion.home_deg": ({}, {"motion.home_deg": [0.0, -90.0, 90.0, 0.0, 30.0, 0.0]}),
    "motion.approach_mm": ({}, {"motion.approach_mm": 20.0}, "points.csv"),
    "motion.points": ({}, {"motion.points": "path"}, "points.csv"),
    "motion.thin.chord_mm": (THIN, {"motion.thin.chord_mm": 0.001}, "bent.csv"),
    "motion.thin.axis_deg": (THIN, {"motion.thin.axis_deg": 0.001}, "bent.csv"),
    "motion.chord_mm": ({"motion.arcs": "lin"}, {"motion.chord_mm": 1.0}, MILL),
    "motion.arcs": ({}, {"motion.arcs": "lin"}, MILL),
    "motion.retract_in_cuts": ({}, {"motion.retract_in_cuts": True}, "round.csv"),
    "motion.rapid_speed_m_s": ({}, {"motion.rapid_speed_m_s": 0.3}),
    "import.format": ({}, {"import.format": "apt"}),
    "import.dialect": ({}, {"import.dialect": "nx"}, MILL),
    "import.units": ({"import.units": "mm"}, {"import.units": "inch"}, "plain.apt"),
    "import.columns": ({}, {"import.columns": "id,y,x,z,i,j,k,depth"}),
    "import.cycle_words": (
        {"import.cycle_words": "depth clearance feed"},
        {"import.cycle_words": "clearance depth feed"},
        "cycle.apt",
    ),
    "import.feed_units": (
        {"import.feed_units": "mm"},
        {"import.feed_units": "inch"},
        "inches.apt",
    ),
    "import.arc_sense": ({}, {"import.arc_sense": "cw"}, MILL),
    "import.head": ({}, {"import.head": "C+z B+y"}, "head.nc"),
    "import.task": ({"import.task": "A"}, {"import.task": "B"}, "tasks.xml"),
    "import.accept_words": ({}, {"import.accept_words": ["CUTCOM"]}, "shifted.apt"),
    "krl.emitter": ({}, {"krl.emitter": "none"}),
    "krl.template": ({}, {"krl.template": "own"}),
    "verify.accept": ({"krl.template": "tuned"}, {"verify.accept": ["$OV_PRO"]}),
    "krl.max_points_per_file": ({}, {"krl.max_points_per_file": 5}),
    "krl.split": ({}, {"krl.split": "operations"}, "two.csv"),
    "krl.motion": ({}, {"krl.motion": "spline"}),
    "krl.home": ({"motion.home_deg": [0.0, -90.0, 90.0, 0.0, 30.0, 0.0]}, {"krl.home": "xhome"}),
    "krl.points": ({}, {"krl.points": "dat"}),
    "krl.kss": ({"krl.motion": "forms"}, {"krl.kss": "8.5"}),
    "krl.advance": ({}, {"krl.advance": 1}),
    "krl.orientation_speed_deg_s": ({}, {"krl.orientation_speed_deg_s": 100.0}),
    "krl.path_speed_max_m_s": ({}, {"krl.path_speed_max_m_s": 0.1}),
    "krl.block_ms": ({}, {"krl.block_ms": 1e5}, MILL),
    "krl.memory_mb": ({}, {"krl.memory_mb": 1e-3}),
    "krl.cam_lines": ({}, {"krl.cam_lines": False}),
    "krl.setup": ({}, {"krl.setup": True}),
    "krl.hooks_example": ({}, {"krl.hooks_example": True}, MILL),
    "krl.inertia_kg_m2": (SETUP, {"krl.inertia_kg_m2": [1.0, 2.0, 3.0]}),
    **{f"krl.hooks.{key}": ({}, {"krl.hooks": {key: "MY_ROUTINE"}}, MILL) for key in HOOKS},
    "krl.hooks.spindle_orient": ({}, {"krl.hooks": {"spindle_orient": "MY_ROUTINE"}}, "bore.apt"),
    "krl.hooks.tap_reverse": ({}, {"krl.hooks": {"tap_reverse": "MY_ROUTINE"}}, "tap.apt"),
    "krl.hooks.tool_change": ({}, {"krl.hooks": {"tool_change": "MY_ROUTINE"}}, MILL),
    "krl.hooks.stops_advance": ({}, {"krl.hooks": {"stops_advance": []}}, MILL),
    "external_axes[].xyz_mm": (
        {"external_axes": [TABLE], **BEHIND},
        {"external_axes.0.xyz_mm": [1500.0, 0.0, 0.0]},
    ),
    "external_axes[].abc_deg": (
        {"external_axes": [TABLE], **BEHIND},
        {"external_axes.0.abc_deg": [0.0, 30.0, 0.0]},
    ),
    "external_axes[].name": ({"external_axes": [RAIL], **FAR}, {"external_axes.0.name": "E2"}),
    "external_axes[].kind": ({"external_axes": [RAIL], **FAR}, {"external_axes": [TABLE]}),
    "external_axes[].axis": ({"external_axes": [RAIL], **FAR}, {"external_axes.0.axis": "-y"}),
    "external_axes[].range_mm": (
        {"external_axes": [RAIL], **FAR},
        {"external_axes.0.range_mm": [0.0, 2500.0]},
    ),
    "external_axes[].range_deg": (
        {"external_axes": [TABLE], **BEHIND},
        {"external_axes.0.range_deg": [-5.0, 5.0]},
    ),
    "external_axes[].speed_mm_s": (
        {"external_axes": [{**RAIL, "range_mm": [-4000.0, 4000.0]}]},
        {"external_axes.0.speed_mm_s": 40.0},
        "apart.csv",
    ),
    "external_axes[].moves_in_cuts": (
        {"external_axes": [{**RAIL, "range_mm": [-4000.0, 4000.0]}]},
        {"external_axes.0.moves_in_cuts": False},
        "long.apt",
    ),
    "external_axes[].speed_deg_s": (
        {"external_axes": [TABLE]},
        {"external_axes.0.speed_deg_s": 4.0},
        "apart.csv",
    ),
}
"""Key of the cell to what else stands in the cell, the change, the input and more of the call."""

LONG_FORM = {"tools[].": "tool.", "bases[].": "workpiece."}
"""Keys of one of several, and of the only one."""


def on_stand(**stand: list[float]) -> dict[str, Any]:
    """Return a second tool that is somewhere while the first one works."""
    box = {"box": {"size_mm": [300.0, 300.0, 300.0]}, "xyz_mm": [150.0, 0.0, 0.0]}
    names = {"number": 2, "name": "other", "cam": ["2"], "axis": "+x", "meshes": [box]}
    place = {"xyz_mm": [1650.0, 40.0, 760.0], "abc_deg": [0.0, 0.0, 0.0], **stand}
    return {LONG: [{**names, "stand": place}]}


for name, value in (("xyz_mm", [0.0, 0.0, 4000.0]), ("abc_deg", [180.0, 0.0, 0.0])):
    setup = {"tool.cam": ["1", "MILL"], "tool.meshes": [NOSE], **on_stand()}
    CASES[f"tools[].stand.{name}"] = (setup, on_stand(**{name: value}), "tools.csv")


def cell_text(*changes: dict[str, Any]) -> str:
    """Return the base cell with dotted keys set; a list is addressed by number."""
    cell = copy.deepcopy(BASE)
    items = [item for change in changes for item in change.items()]
    for key, value in [item for item in items if item[0] != LONG]:
        *way, last = key.split(".")
        at: Any = cell
        for part in way:
            at = at[int(part)] if isinstance(at, list) else at.setdefault(part, {})
        at[last] = copy.deepcopy(value)
    for others in [value for key, value in items if key == LONG][-1:]:
        cell["tools"], cell["bases"] = [cell.pop("tool"), *others], [cell.pop("workpiece")]
    return "\n".join(toml_table(cell)) + "\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The inputs, a mesh, an arm, a model and templates in one folder."""
    place = tmp_path_factory.mktemp("options")
    for name, text in INPUTS.items():
        (place / name).write_text(text)
    trimesh.creation.box((300.0, 300.0, 300.0)).export(place / "cube.stl")
    (place / "arm.urdf").write_text(urdf())
    (place / "heavy.urdf").write_text(heavy_urdf())
    (place / "model.toml").write_text(MODEL)
    (place / "own").mkdir()
    (place / "tuned").mkdir()
    (place / "tuned" / "motion_speeds.j2").write_text(TUNED)
    (place / "own" / "main_head.j2").write_text('{{ points }}\n{% include "ini.j2" %}\n')
    (place / "turned.toml").write_text(cell_text({"optimize.range_deg": [-40.0, -30.0]}))
    made = convert(ConvertRequest(str(place / HOLES), str(place / "turned.toml"), name="old"))
    for name, content in made.files.items():
        (place / name).write_bytes(content)
    return place


@pytest.fixture(scope="module")
def outcome(folder):
    """Return a function: cell text, input and request to all that comes out, or the error."""

    @functools.cache
    def run(text: str, source: str, more: tuple[tuple[str, Any], ...]) -> str:
        path = folder / "cell.toml"
        path.write_text(text)
        options = {k: str(folder / v) if k in ("model", "keep") else v for k, v in more}
        if source == CHECK:
            seen = check_cell(load_cell(path))
            facts = [seen.facts["name"], seen.facts["robot"]]
            facts += [seen.facts["robot_solids"], seen.facts["workpiece"]["name"]]
            return json.dumps([*facts, *map(str, seen.findings)])
        try:
            made = convert(ConvertRequest(str(folder / source), str(path), **options))
        except PostprocError as error:
            return str(error)
        said = document(made)
        del said["timing_s"]
        files = {name: content.decode() for name, content in sorted(made.files.items())}
        return json.dumps([files, said, [str(finding) for finding in made.findings]])

    return run


def leaves(model: type[BaseModel], head: str = "") -> list[str]:
    """Return the dotted names of all keys of a table; ``[]`` marks a list of tables."""
    found = []
    for key, field in model.model_fields.items():
        name = head + (field.alias or key)
        tables = list(_tables(field.annotation))
        if not tables:
            found.append(name)
        for table, is_list in tables:
            found += leaves(table, name + ("[]." if is_list else "."))
    return found


def _tables(annotation: Any, is_list: bool = False) -> typing.Iterator[tuple[type, bool]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, is_list
    for part in typing.get_args(annotation):
        if not isinstance(part, str):
            yield from _tables(part, is_list or typing.get_origin(annotation) is list)


OF_CAMPAIGNS = {key for key in leaves(CellFile) if key.startswith("measuring.")}
"""What no program depends on."""


SOLIDS = ("tool.meshes[].", "workpiece.meshes[].", "robot.link_meshes[].")
"""Lists of solids beside the obstacles."""


def only_one(key):
    """Return the key whose case a key shares: one of several tools, a solid that stands elsewhere.

    That these are read alike is proven below; that each list of solids counts, by its ``xyz_mm``.
    """
    for several, one in LONG_FORM.items():
        if key.startswith(several) and key not in CASES:
            key = one + key.removeprefix(several)
    for place in SOLIDS:
        leaf = key.removeprefix(place)
        if leaf != key and leaf != "xyz_mm" and f"obstacles[].{leaf}" in CASES:
            return f"obstacles[].{leaf}"
    return key


def test_a_solid_is_read_alike_wherever_it_stands(tmp_path):
    trimesh.creation.box((300.0, 300.0, 300.0)).export(tmp_path / "cube.stl")
    shapes = (BLOCK, ROD, {"file": "cube.stl"}, {"file": "cube.stl", "scale": 0.01})
    wrong = []
    for shape in shapes:
        solid = {**shape, "name": "it", "xyz_mm": [1.0, 2.0, 3.0], "abc_deg": [10.0, 20.0, 30.0]}
        lists = {where.removesuffix("[]."): [solid] for where in SOLIDS} | {"obstacles": [solid]}
        lists["robot.link_meshes"] = [{**solid, "link": 6}]
        (tmp_path / "cell.toml").write_text(cell_text(lists))
        cell = load_cell(tmp_path / "cell.toml")
        ((link, arm),) = cell.robot.link_meshes
        found = {repr(one) for one in (*cell.solids, arm)}
        wrong += [] if len(found) == 1 and len(cell.solids) == 3 and link == 6 else [shape]
    assert wrong == []


def test_one_of_several_is_read_as_the_only_one(tmp_path):
    """So what a key of it does to a program needs no second proof."""

    def read(*changes):
        (tmp_path / "cell.toml").write_text(cell_text(*changes))
        cell = load_cell(tmp_path / "cell.toml")
        return repr((replace(cell.tool, source=None), cell.workpiece))

    (tmp_path / "cube.stl").write_bytes(b"")
    wrong = []
    for key, (setup, change, *_) in CASES.items():
        if key.startswith(tuple(LONG_FORM.values())):
            short, several = read(setup, change), read(setup, change, {LONG: []})
            wrong += [key] if short != several or short == read(setup) else []
    assert wrong == []


@pytest.mark.parametrize("key", sorted({*map(only_one, leaves(CellFile))} - OF_CAMPAIGNS))
def test_every_key_of_the_cell_has_an_effect(outcome, key):
    assert key in CASES, f"{key} is new: give it a case here"
    setup, change, *rest = CASES[key]
    source = rest[0] if rest else HOLES
    more = tuple(rest[1].items()) if len(rest) > 1 else ()
    before = outcome(cell_text(setup), source, more)
    after = outcome(cell_text(setup, change), source, more)
    assert before != after
    assert before.startswith("["), before
    if key not in ("schema", "krl.emitter", "import.format"):  # here nothing else is taken
        assert after.startswith("["), after


PLAIN = {"source": "holes.csv", "--cell": "base.toml", "-o": "out"}
BENT = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\nGOTO/100,0,0\n"
"""No end of the file: strict reading refuses it."""
CALLS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "preset": ({}, {"--preset": "stiffest"}),
    "trade": ({"--report": "page.html"}, {"--trade": None}),
    "source": ({}, {"source": "points.csv"}),
    "cell": ({}, {"--cell": "other.toml"}),
    "output": ({}, {"-o": "elsewhere"}),
    "name": ({}, {"--name": "OTHER"}),
    "format": ({}, {"--format": "apt"}),
    "dialect": ({"source": "plain.apt"}, {"--dialect": "nx"}),
    "accept_words": ({"source": "shifted.apt"}, {"--accept-words": "CUTCOM"}),
    "units": ({}, {"--units": "inch"}),
    "columns": ({}, {"--columns": "id,y,x,z,i,j,k,depth"}),
    "task": ({"source": "tasks.xml"}, {"--task": "B"}),
    "cycle_words": (
        {"source": "cycle.apt", "--cycle-words": "depth clearance feed"},
        {"--cycle-words": "clearance depth feed"},
    ),
    "feed_units": (
        {"source": "inches.apt", "--feed-units": "mm"},
        {"--feed-units": "inch"},
    ),
    "head": ({"source": "head.nc"}, {"--head": "C+z B+y"}),
    "arc_sense": ({"source": MILL}, {"--arc-sense": "cw"}),
    "emitter": ({}, {"--emitter": "none"}),
    "recover": ({"source": "bent.apt"}, {"--recover": None}),
    "strategy": ({}, {"--strategy": "smooth"}),
    "objective": ({}, {"--objective": "radial"}),
    "model": ({}, {"--model": "model.toml"}),
    "pins": ({}, {"--pins": "pins.csv"}),
    "keep": ({"--cell": "loose.toml"}, {"--keep": "old.src"}),
    "partial": ({"source": "far.csv"}, {"--partial": None}),
    "report": ({}, {"--report": "page.html"}),
    "spin_map": ({}, {"--spin-map": "map.csv"}),
    "json": ({}, {"--json": None}),
    "quiet": ({}, {"--quiet": None}),
}
"""Option of ``convert`` to what else stands in the call, and the change."""
FIRST = {"partial": 1, "head": 1, "accept_words": 1, "recover": 2, "dialect": 2}
"""Exit code of a call before the change, where it is not good."""


@pytest.fixture
def called(folder, tmp_path, monkeypatch, capsys):
    """Return a function: the parts of a call to exit code, files and what is said."""
    (folder / "base.toml").write_text(cell_text())
    (folder / "other.toml").write_text(cell_text({"tool.number": 9}))
    (folder / "pins.csv").write_text("tag,spin_deg\nH3,-12\n")
    (folder / "bent.apt").write_text(BENT)
    (folder / "far.csv").write_text("x,y,z,i,j,k,depth\n0,0,0,0,0,1,5\n9000,0,0,0,0,1,5\n")
    (folder / "loose.toml").write_text(cell_text({"optimize.keep_loss_percent": 50.0}))
    inputs = ("source", "--cell", "--model", "--pins", "--keep")

    def call(number, parts):
        place = tmp_path / str(number)
        place.mkdir()
        monkeypatch.chdir(place)
        words = ["convert"]
        for key, value in parts.items():
            path = str(folder / value) if key in inputs else value
            words += [*([] if key == "source" else [key]), *([] if value is None else [path])]
        code = app.run(words)
        said = capsys.readouterr()
        files = {p.relative_to(place): p.read_bytes() for p in place.rglob("*") if p.is_file()}
        return code, files, said.out, said.err

    return call


@pytest.mark.parametrize("name", sorted(p.name for p in command.params if p.name))
def test_every_option_of_convert_has_an_effect(called, name):
    assert name in CALLS, f"{name} is new: give it a case here"
    setup, change = CALLS[name]
    before, after = called(1, PLAIN | setup), called(2, PLAIN | setup | change)
    assert before[0] == FIRST.get(name, 0), before
    if name == "quiet":
        assert before[1] == after[1]
        assert before[2]
        assert not after[2]
    elif name == "json":
        assert before[1] == after[1]
        assert json.loads(after[2])["schema"] == "postproc.convert/1"
    else:
        assert before[:2] != after[:2]
