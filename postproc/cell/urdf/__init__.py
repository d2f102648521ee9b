"""Arms described by URDF."""

from postproc.cell.urdf.chain import read_chain
from postproc.cell.urdf.file import fixed_parts, read_urdf_robot
from postproc.cell.urdf.numbers import origin_of, values_of
from postproc.cell.urdf.xacro import expanded, find_urdf, is_xacro, resolved_mesh
