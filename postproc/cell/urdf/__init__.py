"""Arms described by URDF."""

from postproc.cell.urdf.body import fixed_parts, origin_of, values_of
from postproc.cell.urdf.chain import read_chain
from postproc.cell.urdf.file import read_urdf_robot

__all__ = [
    "fixed_parts",
    "origin_of",
    "read_chain",
    "read_urdf_robot",
    "values_of",
]
