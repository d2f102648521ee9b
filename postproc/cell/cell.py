"""The robot cell: robot, tool, workpiece, obstacles, and the options of planning. SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray, frozen_floats
from postproc.cell.choices import Origin, Provenance, RobotSolids
from postproc.cell.schema import Instrument, KrlOptions, Limits, Motion, Optimize, Process, Reading
from postproc.errors import CellError, SourceRef
from postproc.records import dataclass
from postproc.units import STANDARD_GRAVITY


@dataclass(frozen=True, slots=True)
class OpwGeometry:
    """Ortho-parallel arm with spherical wrist (Brandstoetter et al. 2014), lengths [m].

    ``signs`` (6,), ``offsets`` (6,) [rad]: q_opw = signs * q - offsets.
    """

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    signs: FloatArray
    offsets: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "signs", (6,))
        frozen_floats(self, "offsets", (6,))


@dataclass(frozen=True, slots=True)
class UrdfGeometry:
    """An arm described by a URDF file; ``tip`` names the flange link (None: the last link)."""

    path: Path
    tip: str | None = None


@dataclass(frozen=True, slots=True)
class MeshPlacement:
    """A solid: mesh file, box or cylinder, in the frame its owner names.

    ``size`` (3,) [m] for a box; ``radius``, ``length`` [m] for a cylinder along z, centred.
    ``T_owner_mesh`` (4, 4); ``scale``: metres per file unit; ``cutting``: may touch the workpiece.
    """

    name: str
    T_owner_mesh: FloatArray
    file: Path | None = None
    scale: float = 1e-3
    size: FloatArray | None = None
    radius: float = 0.0
    length: float = 0.0
    cutting: bool = False

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "T_owner_mesh", (4, 4))
        frozen_floats(self, "size", (3,))


@dataclass(frozen=True, slots=True)
class ExternalAxis:
    """A linear axis or positioner that the controller moves as E1..E6.

    ``kind``: ``rail`` (carries the robot along ``axis`` of the world) or ``positioner`` (turns the
    workpiece about ``axis`` through ``T_world_axis``'s origin). Limits [m] or [rad] and per second.
    ``moves_in_cuts``: the axis may move while the tool cuts.
    """

    name: str
    kind: str
    axis: FloatArray
    T_world_axis: FloatArray
    q_min: float
    q_max: float
    qd_max: float
    moves_in_cuts: bool = True

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "axis", (3,))
        frozen_floats(self, "T_world_axis", (4, 4))


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """A six-axis arm: geometry, limits [rad], speeds [rad/s], accelerations [rad/s^2], stiffness.

    ``link_mass`` (6,) [kg] and ``link_com`` (6, 3) [m] (each in its link frame at the joint, axes
    of robroot in the zero pose) are NaN where no source gives them. ``joint_stiffness`` (6,)
    [N*m/rad] or None. Limits and speeds that no source gives are NaN; ``qddd_max`` (6,) [rad/s^3]
    is the jerk, ``torque_max`` (6,) [N*m] what the joints can give, None where nobody has said it;
    ``has_inertia``: the URDF gives mass and inertia of every link. ``origins`` maps field names to
    where the numbers come from, ``doubts`` to what speaks against them.
    """

    name: str
    geometry: OpwGeometry | UrdfGeometry
    q_min: FloatArray
    q_max: FloatArray
    qd_max: FloatArray
    qdd_max: FloatArray
    T_world_robroot: FloatArray
    payload: float = float("nan")
    mass: float = float("nan")
    repeatability: float = float("nan")
    qddd_max: FloatArray | None = None
    torque_max: FloatArray | None = None
    has_inertia: bool = False
    joint_stiffness: FloatArray | None = None
    link_mass: FloatArray | None = None
    link_com: FloatArray | None = None
    link_meshes: tuple[tuple[int, MeshPlacement], ...] = ()
    origins: Mapping[str, Origin] = field(default_factory=dict)
    doubts: Mapping[str, str] = field(default_factory=dict)
    solids: RobotSolids = RobotSolids.OUTLINE

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        joints = ("q_min", "q_max", "qd_max", "qdd_max", "qddd_max", "torque_max", "link_mass")
        for name in (*joints, "joint_stiffness"):
            frozen_floats(self, name, (6,))
        frozen_floats(self, "link_com", (6, 3))
        frozen_floats(self, "T_world_robroot", (4, 4))

    @property
    def has_acceleration(self) -> bool:
        """Whether somebody has said the accelerations; else they are assumed."""
        origin = self.origins.get("qdd_max")
        return origin is not None and origin.provenance is not Provenance.ASSUMED

    @property
    def gravity(self) -> FloatArray:
        """(3,) [m/s^2] in axes of robroot."""
        return np.asarray(self.T_world_robroot[2, :3] * -STANDARD_GRAVITY)


@dataclass(frozen=True, slots=True)
class Tool:
    """The tool on the flange: TCP, tool axis (unit, TCP axes, out of the tool into the part).

    ``known_axis`` is None for a tool of a controller that nobody has told the axis of; ``source``:
    where the cell has it.
    ``cuts_clockwise``: which way the spindle turns while it cuts, seen from it towards the tool.
    """

    number: int
    name: str
    T_flange_tcp: FloatArray
    known_axis: FloatArray | None
    mass: float = float("nan")
    com: FloatArray | None = None
    """(3,) [m] in the flange."""
    meshes: tuple[MeshPlacement, ...] = ()
    cuts_clockwise: bool = True
    cam: tuple[str, ...] = ()
    """Numbers and names by which CAM files call it, as ``cam_key`` gives them."""
    inertia: FloatArray | None = None
    """(3,) [kg m^2], principal, None where it is not known."""
    diameter: float = float("nan")
    """Of the cutter [m]."""
    T_world_stand: FloatArray | None = None
    """Its flange while it is not mounted, None where it is not known."""
    source: SourceRef | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "T_flange_tcp", (4, 4))
        for name in ("known_axis", "com", "inertia"):
            frozen_floats(self, name, (3,))
        if self.T_world_stand is not None:
            frozen_floats(self, "T_world_stand", (4, 4))

    @property
    def axis(self) -> FloatArray:
        """(3,) unit, TCP axes, out of the tool into the part.

        Raises:
            CellError: CEL031 if the cell does not say it: no job can use this tool.
        """
        if self.known_axis is None:
            text = (
                f"tool {self.number} {self.name!r} has no axis, expected the TCP axis that "
                "points into the part"
            )
            hint = 'add axis = "+z", or the axis that is right on the robot'
            raise CellError("CEL031", text, self.source, hint)
        return self.known_axis


@dataclass(frozen=True, slots=True)
class Workpiece:
    """A workpiece: KUKA BASE number, CAM coordinates in robroot, solids in CAM coordinates."""

    number: int
    T_robroot_base: FloatArray
    meshes: tuple[MeshPlacement, ...] = ()
    cam: tuple[str, ...] = ()
    """Names by which CAM files call this setup, as ``cam_key`` gives them."""
    name: str = ""
    """As the controller calls it."""

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "T_robroot_base", (4, 4))


@dataclass(frozen=True, slots=True)
class Cell:
    """Everything about the cell that a plan needs. ``path``: the file it came from.

    Whoever works with one tool in one setup takes ``tool`` and ``workpiece``: those at
    ``tool_index`` and ``base_index``, the first ones unless ``with_tool`` has chosen others. The
    solids of all setups stand in the cell but those that overlap the setup in work; those of the
    other tools where they have a stand.

    ``origins`` maps keys of the cell file such as ``motion.feed_mm_min`` to where the value comes
    from: the file, the robot, or a default.
    """

    name: str
    path: str
    robot: Robot
    tools: tuple[Tool, ...]
    bases: tuple[Workpiece, ...]
    obstacles: tuple[MeshPlacement, ...]
    limits: Limits
    optimize: Optimize
    process: Process
    motion: Motion
    krl: KrlOptions
    reading: Reading = Reading()
    accept: tuple[str, ...] = ()
    """What ``verify`` cannot judge and takes on trust."""
    external_axes: tuple[ExternalAxis, ...] = ()
    instrument: Instrument = Instrument()
    origins: Mapping[str, Origin] = field(default_factory=dict)
    joint_compliances: tuple[Callable[[FloatArray], FloatArray], ...] = field(
        default=(), compare=False, repr=False
    )
    """For each tool joint angles (n, 6) [rad] to joint compliance (n, 6) [rad/(N*m)], where a model
    of the arm is known; none: the constant ``joint_stiffness`` counts everywhere."""
    model_doubt: Callable[[FloatArray], FloatArray] | None = field(
        default=None, compare=False, repr=False
    )
    """Joint angles (n, 6) [rad] to ``Reach.doubt`` (n,), where a model says where it holds."""
    tool_index: int = 0
    base_index: int = 0

    @property
    def tool(self) -> Tool:
        """The tool in work."""
        return self.tools[self.tool_index]

    @property
    def workpiece(self) -> Workpiece:
        """The workpiece in work."""
        return self.bases[self.base_index]

    @property
    def solids(self) -> tuple[MeshPlacement, ...]:
        """The solids of all tools, all workpieces and of the obstacles."""
        tools = [mesh for tool in self.tools for mesh in tool.meshes]
        return (*tools, *(mesh for base in self.bases for mesh in base.meshes), *self.obstacles)

    def with_keys(self, keys: Mapping[str, Any]) -> Cell:
        """Put what a call gives in the place of keys of the cell.

        Args:
            keys: by the names of their fields; None and empty texts leave the cell's own.

        Returns:
            The cell with them.

        Raises:
            CellError: PLN204 for a word that a key does not take.
        """
        if not keys:
            return self
        tables = {name: getattr(self, name) for name in ("reading", "krl", "optimize")}
        try:
            return replace(self, **{name: own.with_keys(keys) for name, own in tables.items()})
        except ValueError as problem:
            raise CellError("PLN204", str(problem), SourceRef(self.path)) from None

    def with_tool(self, index: int, base: int = 0) -> Cell:
        """Put one of the tools to work in one of the setups.

        Args:
            index: of the tool in ``tools``.
            base: of the setup in ``bases``.

        Returns:
            The cell whose ``tool`` and ``workpiece`` are these.
        """
        if (index, base) == (self.tool_index, self.base_index):
            return self
        return replace(self, tool_index=index, base_index=base)

    def for_tool(self, number: int | None) -> Cell:
        """Put the tool to work that a call asks for.

        Args:
            number: KUKA TOOL number; None: the only tool of the cell.

        Returns:
            The cell with this tool in its first setup.

        Raises:
            CellError: CEL015 if the cell has no such tool, or several and none is asked for.
        """
        numbers = [tool.number for tool in self.tools]
        if number is None and len(numbers) == 1:
            return self
        if number in numbers:
            return self.with_tool(numbers.index(number))
        known = ", ".join(f"{tool.number} {tool.name}".strip() for tool in self.tools)
        if number is None:
            message = f"the cell has {len(numbers)} tools: {known}"
            hint = "name the one on the flange with --tool N"
        else:
            message, hint = f"the cell has no tool {number}", f"it has {known}"
        raise CellError("CEL015", message, SourceRef(self.path), hint)

    def rebased(self, move: Callable[[FloatArray], FloatArray]) -> Cell:
        """Move all setups.

        Args:
            move: a function T_robroot_base (4, 4) -> T_robroot_base (4, 4).

        Returns:
            The cell with every setup where ``move`` puts it.
        """
        moved = (replace(base, T_robroot_base=move(base.T_robroot_base)) for base in self.bases)
        return replace(self, bases=tuple(moved))

    def tcp_of(self, tool: AnyIntArray) -> FloatArray:
        """Look up tool frames.

        Args:
            tool: (n,) indices of ``tools``.

        Returns:
            T_flange_tcp (n, 4, 4) [m].
        """
        return np.array([entry.T_flange_tcp for entry in self.tools])[tool]

    def axes_of(self, tool: AnyIntArray) -> FloatArray:
        """Look up tool axes; a tool that nothing asks for needs none.

        Args:
            tool: (n,) indices of ``tools``, -1 for none.

        Returns:
            Unit vectors (n, 3) in the TCP frame, out of the tool into the part.
        """
        table = np.full((len(self.tools), 3), np.nan)
        for index in np.unique(tool[tool >= 0]).tolist():
            table[index] = self.tools[index].axis
        return table[tool]

    @property
    def joint_compliance(self) -> Callable[[FloatArray], FloatArray] | None:
        """What a model of the arm knows with the tool in work."""
        return self.joint_compliances[self.tool_index] if self.joint_compliances else None

    @property
    def has_stiffness(self) -> bool:
        """Whether the cell or a model of its arm knows how stiff the joints are."""
        return self.joint_stiffness is not None or self.joint_compliance is not None

    @property
    def joint_stiffness(self) -> FloatArray | None:
        """(6,) [N*m/rad] of the robot, None where the cell gives none."""
        return self.robot.joint_stiffness

    @property
    def T_robroot_base(self) -> FloatArray:
        """(4, 4) CAM coordinates in robroot."""
        return np.asarray(self.workpiece.T_robroot_base)
