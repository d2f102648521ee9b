"""The robots of the check: dimensions of their own, cell files and a URDF for the product."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tools.blind.chain import Array, Dimensions


@dataclass(frozen=True)
class RobotClass:
    """A kind of robot.

    Args:
        name: of the class; builtin: robot name of the product, or None: a URDF is written.
        arm: nominal dimensions; range_deg: (6, 2) of wide poses; start_deg: (6,) of patches.
        tool: (3,) tool point in the flange; tool_mass, tool_com: what the cell says of the tool.
        force: largest load [N]; extent: half width of a patch [m].
    """

    name: str
    builtin: str | None
    arm: Dimensions
    range_deg: Array
    start_deg: Array
    tool: Array
    tool_mass: float
    tool_com: Array
    force: float
    extent: float


def kuka(lengths: tuple[float, ...], mass: list[float], give: Array) -> Dimensions:
    """Return a KUKA arm from (a1, a2, c1, c2, c3, c4) [m], stretched along x with all angles 0."""
    a1, a2, c1, c2, c3, c4 = lengths
    wrist = [a1 + c2 + c3, 0.0, c1 - a2]
    elbow = [a1 + c2, 0.0, c1]
    point = np.array([[0, 0, 0], [a1, 0, c1], elbow, [a1 + c2, 0, c1 - a2], wrist, wrist])
    axis = np.array([[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]])
    flange = np.array([[0, 0, 1, wrist[0] + c4], [0, 1, 0, 0], [-1, 0, 0, wrist[2]], [0, 0, 0, 1]])
    com = np.array(
        [
            *([0.35 * a1, 0, 0.6 * c1], [a1 + 0.45 * c2, 0, c1 + 0.03]),
            *([a1 + c2 + 0.2 * c3, 0, c1 - a2 + 0.08], [a1 + c2 + 0.7 * c3, 0, c1 - a2]),
            *([wrist[0] + 0.1 * c4, 0, wrist[2]], [wrist[0] + 0.8 * c4, 0, wrist[2]]),
        ]
    )
    return Dimensions(axis.astype(float), point, flange.astype(float), np.array(mass), com, give)


def _cobot() -> Dimensions:
    point = np.array(
        [
            *([0, 0, 0], [0, 0, 0.1273], [0.612, 0, 0.1273], [1.1843, 0, 0.1273]),
            *([1.1843, 0.1639, 0.1273], [1.1843, 0.1639, 0.0116]),
        ]
    )
    axis = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 1, 0]])
    flange = np.array([[-1, 0, 0, 1.1843], [0, 0, 1, 0.2561], [0, 1, 0, 0.0116], [0, 0, 0, 1]])
    com = np.array(
        [
            *([0, 0.02, 0.12], [0.28, 0.15, 0.1273], [0.86, 0.04, 0.1273]),
            *([1.1843, 0.12, 0.12], [1.1843, 0.16, 0.03], [1.1843, 0.23, 0.0116]),
        ]
    )
    mass = np.array([7.4, 13.4, 4.1, 2.0, 1.9, 0.35])
    give = 1.0 / np.array([6e4, 6e4, 4e4, 1.2e4, 1.2e4, 1.2e4])
    return Dimensions(axis.astype(float), point, flange.astype(float), mass, com, give)


def _bounds(*pairs: tuple[float, float]) -> Array:
    return np.array(pairs, dtype=float)


KR500 = RobotClass(
    "kr500",
    "kuka_kr500_r2830",
    kuka(
        (0.5, 0.055, 1.045, 1.3, 1.025, 0.29),
        [790.0, 480.0, 500.0, 95.0, 60.0, 25.0],
        1.0 / np.array([1.5e7, 6.0e6, 5.2e6, 4.7e5, 2.4e5, 3.3e5]),
    ),
    _bounds((-110, 110), (-115, -15), (15, 130), (-170, 170), (20, 110), (-170, 170)),
    np.array([5.0, -70.0, 95.0, 8.0, 55.0, 10.0]),
    np.array([0.107, 0.0, 0.362]),
    120.0,
    np.array([0.0, 0.0, 0.18]),
    2000.0,
    0.35,
)
KR210 = RobotClass(
    "kr210",
    "kuka_kr210_r2700_2",
    kuka(
        (0.33, -0.115, 0.645, 1.15, 1.22, 0.215),
        [340.0, 250.0, 175.0, 45.0, 19.0, 8.0],
        1.0 / np.array([6.2e6, 4.1e6, 3.0e6, 3.1e5, 2.6e5, 2.0e5]),
    ),
    _bounds((-110, 110), (-120, -25), (30, 130), (-170, 170), (20, 110), (-170, 170)),
    np.array([-10.0, -75.0, 100.0, -12.0, 50.0, 15.0]),
    np.array([0.05, -0.04, 0.28]),
    60.0,
    np.array([0.01, 0.0, 0.12]),
    1000.0,
    0.30,
)
COBOT = RobotClass(
    "cobot",
    None,
    _cobot(),
    _bounds((-150, 150), (-140, -40), (35, 130), (-150, 150), (30, 150), (-150, 150)),
    np.array([20.0, -90.0, 100.0, -100.0, 80.0, 10.0]),
    np.array([0.03, 0.02, 0.12]),
    2.0,
    np.array([0.0, 0.0, 0.05]),
    60.0,
    0.18,
)
CLASSES = (KR500, KR210, COBOT)


def urdf(robot: RobotClass) -> str:
    """Return the robot as URDF: frames parallel to the root in the zero pose, rounded masses."""
    arm, lines = robot.arm, ['<?xml version="1.0"?>', f'<robot name="{robot.name}">']
    lines.append('  <link name="base_link"/>')
    for k in range(6):
        com = _numbers(np.round(arm.com[k] - arm.point[k], 2))
        lines += [
            f'  <link name="link_{k + 1}">',
            f'    <inertial><origin xyz="{com}"/><mass value="{arm.mass[k]:.1f}"/>',
            '      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>',
            "  </link>",
        ]
    lines.append('  <link name="flange"/>')
    before = np.zeros(3)
    for k in range(6):
        parent = "base_link" if k == 0 else f"link_{k}"
        lines += [
            f'  <joint name="joint_{k + 1}" type="revolute">',
            f'    <parent link="{parent}"/><child link="link_{k + 1}"/>',
            f'    <origin xyz="{_numbers(arm.point[k] - before)}"/>',
            f'    <axis xyz="{_numbers(arm.axis[k])}"/>',
            '    <limit lower="-6.2832" upper="6.2832" velocity="2.0" effort="300"/>',
            "  </joint>",
        ]
        before = arm.point[k]
    roll, pitch, yaw = _rpy(arm.flange[:3, :3])
    lines += [
        '  <joint name="flange_joint" type="fixed">',
        '    <parent link="link_6"/><child link="flange"/>',
        f'    <origin xyz="{_numbers(arm.flange[:3, 3] - before)}" '
        f'rpy="{roll:.15g} {pitch:.15g} {yaw:.15g}"/>',
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _numbers(values: Array) -> str:
    return " ".join(f"{value + 0.0:.6g}" for value in values)


def _rpy(R: Array) -> tuple[float, float, float]:
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def cell_text(robot: RobotClass, stiffness: Array | None) -> str:
    """Return the cell file given to the product; ``stiffness`` (6,) [N*m/rad] or none."""
    source = (
        f'model = "{robot.builtin}"' if robot.builtin else 'urdf = "robot.urdf"\ntip = "flange"'
    )
    tool = ", ".join(f"{1e3 * x:.3f}" for x in robot.tool)
    cog = ", ".join(f"{1e3 * x:.3f}" for x in robot.tool_com)
    lines = [
        'schema = "postproc.cell/1"',
        f'name = "blind_{robot.name}"',
        "",
        "[robot]",
        source,
        "",
        "[tool]",
        "number = 1",
        'name = "target"',
        f"frame = {{ xyz_mm = [{tool}], abc_deg = [0, 0, 0] }}",
        'axis = "+z"',
        f"mass_kg = {robot.tool_mass:.1f}",
        f"cog_mm = [{cog}]",
        "",
        "[workpiece]",
        "number = 1",
        "frame = { xyz_mm = [1200, 0, 300], abc_deg = [0, 0, 0] }",
    ]
    if stiffness is not None:
        lines += ["", "[stiffness]", f"joint_Nmm_per_rad = {stiffness_text(stiffness)}"]
    return "\n".join(lines) + "\n"


def model_text(stiffness: Array) -> str:
    """Return a model file that knows the joint stiffness (6,) [N*m/rad] already."""
    return (
        'schema = "postproc.model/1"\n\n[effects.joint_compliance]\n'
        f"stiffness_Nmm_per_rad = {stiffness_text(stiffness)}\n"
    )


def stiffness_text(stiffness: Array) -> str:
    """Return joint stiffness [N*m/rad] as a TOML list in N*mm/rad."""
    return "[" + ", ".join(f"{1e3 * k:.5e}" for k in stiffness) + "]"
