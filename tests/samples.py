"""A cell, a CAM file and programs that several tests run."""

from pathlib import Path

import numpy as np

from postproc.cell.file import load_cell
from postproc.krl.text.parse import parse_files
from postproc.model.toolpath import Arcs, Cycle, MotionKind, ToolPath
from postproc.readers.base import ReadOptions, read
from tests.cells import STIFFNESS, cell_text

CELL_TEXT = cell_text(
    "[motion]\nrapid_percent = 50\nfeed_mm_min = 600\napproximation_mm = 1.0\n",
    STIFFNESS,
    tool="mass_kg = 80.0\n",
    origin=(1900, 0, 900),
)
APT_TEXT = """PARTNO/DEMO
UNITS/MM
LOADTL/1
SPINDL/3000,RPM,CLW
COOLNT/FLOOD
RAPID
GOTO/-60.,-150.,200.,-1.,0.,0.
FEDRAT/600.,MMPM
GOTO/0.,-150.,200.
GOTO/0.,-100.,200.
GOTO/0.,-100.,260.
CIRCLE/0.,-80.,260.,1.,0.,0.,20.
GOTO/0.,-80.,280.
FEDRAT/300.,MMPM
GOTO/0.,0.,280.
DELAY/1.5
GOTO/0.,20.,280.
GOTO/0.,20.,220.
RAPID
GOTO/-60.,20.,220.
STOP
SPINDL/OFF
SPINDL/1200,RPM,CLW
CYCLE/DRILL,FEDTO,8.,MMPM,150.,RAPTO,3.,RTRCTO,30.,DWELL,0.5
GOTO/0.,100.,200.
GOTO/0.,130.,200.
GOTO/0.,160.,200.
GOTO/0.,160.,240.
CYCLE/OFF
CYCLE/DEEP2,FEDTO,12.,1STPECK,5.,SUBPECK,4.,MMPM,100.,RAPTO,3.,RTRCTO,30.
GOTO/0.,130.,240.
GOTO/0.,100.,240.
CYCLE/OFF
COOLNT/OFF
SPINDL/OFF
FINI
"""


def cell_in(folder: Path, extra: str = "", old: str = "", new: str = ""):
    """The cell, read from its text, with tables added or a passage replaced."""
    path = folder / "cell.toml"
    text = CELL_TEXT.replace(old, new) if old else CELL_TEXT
    path.write_text(text + extra)
    return load_cell(path)


def apt_in(folder: Path, text: str = APT_TEXT):
    """The toolpath of a CAM file."""
    path = folder / "demo.apt"
    path.write_text(text)
    return read(str(path), ReadOptions(tool_axis=(1.0, 0.0, 0.0)))


def modules(*lines, data=(), name="T", **others):
    """Modules from the lines of a routine, of its data list, and from texts of other files."""
    files = {f"{name}.src": "\r\n".join([f"DEF {name}( )", *lines, "END", ""]).encode()}
    if data:
        files[f"{name}.dat"] = "\r\n".join([f"DEFDAT {name}", *data, "ENDDAT", ""]).encode()
    for other, text in others.items():
        files[f"{other}.src"] = text.replace("\n", "\r\n").encode()
    return parse_files(files)


AT_PART = {"old": "xyz_mm = [1900, 0, 900]", "new": "xyz_mm = [1900, 100, 1100]"}
"""A workpiece frame that the arm reaches around its origin in the pose of ``START``."""
START = "PTP {A1 -5.14,A2 -73.15,A3 101.79,A4 -174.35,A5 -61.92,A6 -7.83}"
HEAD = (
    "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM()",
    "INTERRUPT ON 3",
    "BAS(#INITMOV,0)",
    "BAS(#TOOL,1)",
    "BAS(#BASE,1)",
    "BAS(#VEL_PTP,50)",
    "$CIRC_TYPE=#BASE",
    "$VEL.CP=0.01",
    "$APO.CDIS=1.0",
)


def at(x, y, z, blend="", word="LIN"):
    """A motion to a point with the tool axis along +x of the part."""
    pose = f"{{X {x:.4f},Y {y:.4f},Z {z:.4f},A 0.0,B 0.0,C 175.0}}"
    return f"{word} {pose} {blend}".rstrip()


def path_of(points, kind=None, feed=0.01, cycles=(), arcs=None, events=(), axes=(-1.0, 0.0, 0.0)):
    """A toolpath from points [mm]; ``kind``: one letter a point, R L A H."""
    n = len(points)
    letters = kind or "R" + "L" * (n - 1)
    kinds = [{"R": 0, "L": 1, "A": 2, "H": 3}[letter] for letter in letters]
    is_arc = np.array(kinds) == MotionKind.ARC
    is_hole = np.array(kinds) == MotionKind.HOLE
    return ToolPath(
        path="part.apt",
        name="part",
        format="apt",
        dialect="apt",
        units="mm",
        points=np.array(points, dtype=float) * 1e-3,
        axes=np.broadcast_to(np.array(axes, dtype=float), (n, 3)),
        kind=kinds,
        feed=np.where(np.array(kinds) == 0, np.nan, feed),
        line=np.arange(1, n + 1),
        operation=np.full(n, -1),
        tool=np.full(n, -1),
        arc=np.where(is_arc, np.cumsum(is_arc) - 1, -1),
        cycle=np.where(is_hole, 0, -1),
        cycles=tuple(cycles),
        arcs=arcs if arcs is not None else Arcs.none(),
        events=tuple(events),
    )


DRILL = Cycle("drill", depth=8e-3, clearance=3e-3, retract=30e-3, dwell=0.5, feed=0.0025)
