"""The keys of ``cell.toml``: types, units, ranges, defaults and meaning, in file units.

This is the only place where a key of the cell is described and has its default; the reference page
is generated from it. ``postproc.cell.options`` and ``postproc.cell.file`` turn it into SI units.
"""

from postproc.cell.schema.cellfile import (
    CellFile,
    CutterTable,
    ImportTable,
    MeasuringTable,
    ToolTable,
    WorkpieceTable,
)
from postproc.cell.schema.krl import HooksTable, KrlTable
from postproc.cell.schema.motion import MotionTable, ProcessTable
from postproc.cell.schema.optimize import LimitsTable, OptimizeTable
from postproc.cell.schema.robot import DimensionsTable, ExternalAxisTable, RobotTable
from postproc.cell.schema.table import Placement, Solid, Table, ToolSolid, default_of
