"""The robot cell: file, schema, robot data."""

from postproc.cell.cache import cell_files, shared_cell
from postproc.cell.cell import (
    Cell,
    ExternalAxis,
    MeshPlacement,
    OpwGeometry,
    Robot,
    Tool,
    UrdfGeometry,
    Workpiece,
)
from postproc.cell.choices import (
    ArcMotion,
    HomeStyle,
    Index,
    Kss,
    MotionStyle,
    Origin,
    PathEntry,
    PointPlace,
    PointService,
    Preset,
    Provenance,
    RobotSolids,
    SpindleStart,
    Split,
    Strategy,
)
from postproc.cell.edit import (
    ABC_DIGITS,
    XYZ_DIGITS,
    base_location,
    cell_changes,
    edited_cell,
    frame_document,
    refitted,
)
from postproc.cell.file import cell_toml, load_cell, parse_cell
from postproc.cell.forms import cam_key
from postproc.cell.reference import cell_reference
from postproc.cell.robotfile import (
    KUKA_OFFSETS_DEG,
    KUKA_SIGNS,
    LENGTHS,
    find_robot,
    load_robot,
    missing_numbers,
    require_numbers,
    robot_names,
    robot_notes,
    robot_title,
    same_type,
    type_of,
)
from postproc.cell.schema import (
    CALL_KEYS,
    Instrument,
    KrlOptions,
    Optimize,
    Options,
    Reading,
    TiltRange,
    call_keys,
    key_said,
)
from postproc.cell.text import cell_text
from postproc.cell.urdf import (
    expanded,
    find_urdf,
    fixed_parts,
    is_xacro,
    origin_of,
    read_chain,
    read_urdf_robot,
    resolved_mesh,
    values_of,
)
