"""Arms described by URDF."""

from postproc.cell.urdf.body import fixed_parts
from postproc.cell.urdf.chain import read_chain
from postproc.cell.urdf.file import read_urdf_robot
from postproc.cell.urdf.numbers import origin_of, values_of
from postproc.cell.urdf.xacro import expanded, find_urdf, is_xacro, resolved_mesh

__all__ = [
    "expanded",
    "find_urdf",
    "fixed_parts",
    "is_xacro",
    "origin_of",
    "read_chain",
    "read_urdf_robot",
    "resolved_mesh",
    "values_of",
]
