"""The robot cell: file, schema, robot data."""

from postproc.cell.cache import cell_files, shared_cell
from postproc.cell.cell import (
    Cell,
    ExternalAxis,
    KrlOptions,
    MeshPlacement,
    Optimize,
    OpwGeometry,
    Origin,
    Provenance,
    Robot,
    TiltRange,
    Tool,
    UrdfGeometry,
    Workpiece,
)
from postproc.cell.choices import (
    ArcMotion,
    Index,
    Kss,
    MotionStyle,
    PointPlace,
    PointService,
    Split,
    Strategy,
)
from postproc.cell.file import load_cell, parse_cell
from postproc.cell.forms import cam_key
from postproc.cell.reference import cell_reference
from postproc.cell.robotfile import (
    LENGTHS,
    find_robot,
    load_robot,
    missing_numbers,
    require_numbers,
    robot_names,
    robot_notes,
    robot_title,
)
from postproc.cell.robotnames import same_type, type_of
from postproc.cell.text import cell_text
from postproc.cell.urdf import fixed_parts, origin_of, read_chain, values_of

__all__ = [
    "LENGTHS",
    "ArcMotion",
    "Cell",
    "ExternalAxis",
    "Index",
    "KrlOptions",
    "Kss",
    "MeshPlacement",
    "MotionStyle",
    "Optimize",
    "OpwGeometry",
    "Origin",
    "PointPlace",
    "PointService",
    "Provenance",
    "Robot",
    "Split",
    "Strategy",
    "TiltRange",
    "Tool",
    "UrdfGeometry",
    "Workpiece",
    "cam_key",
    "cell_files",
    "cell_reference",
    "cell_text",
    "find_robot",
    "fixed_parts",
    "load_cell",
    "load_robot",
    "missing_numbers",
    "origin_of",
    "parse_cell",
    "read_chain",
    "require_numbers",
    "robot_names",
    "robot_notes",
    "robot_title",
    "same_type",
    "shared_cell",
    "type_of",
    "values_of",
]
