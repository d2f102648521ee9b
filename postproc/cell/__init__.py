"""The robot cell: file, schema, robot data."""

from postproc.cell.cache import cell_files, shared_cell
from postproc.cell.cell import (
    Cell,
    ExternalAxis,
    MeshPlacement,
    OpwGeometry,
    Origin,
    Provenance,
    Robot,
    UrdfGeometry,
)
from postproc.cell.file import load_cell, parse_cell
from postproc.cell.reference import cell_reference
from postproc.cell.robotfile import load_robot, nearest_robot, robot_names, robot_title
from postproc.cell.text import cell_text
from postproc.cell.urdf import fixed_parts, origin_of, read_chain, values_of

__all__ = [
    "Cell",
    "ExternalAxis",
    "MeshPlacement",
    "OpwGeometry",
    "Origin",
    "Provenance",
    "Robot",
    "UrdfGeometry",
    "cell_files",
    "cell_reference",
    "cell_text",
    "fixed_parts",
    "load_cell",
    "load_robot",
    "nearest_robot",
    "origin_of",
    "parse_cell",
    "read_chain",
    "robot_names",
    "robot_title",
    "shared_cell",
    "values_of",
]
