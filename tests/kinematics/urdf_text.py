"""URDF text for arms made in the tests."""

import numpy as np


def rpy_of(R):
    """Roll, pitch, yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll)."""
    if abs(R[2, 0]) > 1.0 - 1e-12:
        return np.arctan2(-R[1, 2], R[1, 1]), -np.sign(R[2, 0]) * np.pi / 2.0, 0.0
    roll, yaw = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    return roll, np.arcsin(-R[2, 0]), yaw


def joint(name, kind, parent, child, xyz, rpy, axis="0 0 1", limit="-3.1 3.1 2.0"):
    lower, upper, speed = limit.split()
    limits = f'<limit lower="{lower}" upper="{upper}" velocity="{speed}" effort="1"/>'
    moving = f'<axis xyz="{axis}"/>{limits}' if kind != "fixed" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{moving}</joint>'
    )


def urdf_of(placements, axes, digits=17):
    """URDF of six joints (7 placements, 6 axes) named j1..j6 from base to flange."""

    def text(values):
        return " ".join(f"{v:.{digits}g}" for v in values)

    lines = ['<robot name="arm"><link name="base"/>']
    parent = "base"
    for i, T in enumerate(placements):
        child = f"link_{i + 1}" if i < 6 else "flange"
        lines.append(f'<link name="{child}"/>')
        kind, axis = ("revolute", text(axes[i])) if i < 6 else ("fixed", "")
        place = text(T[:3, 3]), text(rpy_of(T[:3, :3]))
        lines.append(joint(f"j{i + 1}", kind, parent, child, *place, axis=axis))
        parent = child
    return "\n".join([*lines, "</robot>"])


def maker_style_urdf():
    """The KR 500 R2830 as a robot maker writes it: every axis z, turned joint frames."""
    right, straight = "1.5707963267948966", "3.141592653589793"
    frames = [
        ("0 0 0.4", f"{straight} 0 0"),
        ("0.5 0 -0.645", f"{right} 0 0"),
        ("1.3 0 0", "0 0 0"),
        ("0.564 0.055 0", f"{right} 0 -{right}"),
        ("0 0 -0.461", f"0 {right} {right}"),
        ("0.29 0 0", f"{right} 0 -{right}"),
    ]
    lines = ['<robot name="kr500"><link name="world"/><link name="base"/>']
    lines.append(joint("foot", "fixed", "world", "base", "0 0 0", "0 0 0"))
    parent = "base"
    for i, (xyz, rpy) in enumerate(frames, start=1):
        lines.append(f'<link name="link_{i}"/>')
        lines.append(joint(f"joint_{i}", "revolute", parent, f"link_{i}", xyz, rpy))
        parent = f"link_{i}"
    lines.append('<link name="tool0"/>')
    lines.append(joint("end", "fixed", parent, "tool0", "0 0 0", f"{straight} 0 {straight}"))
    return "\n".join([*lines, "</robot>"])


PLACES = ("0 0 0.4", "0.5 0 0.6", "0 0 1.3", "1.0 0 0", "0 0 0", "0.3 0 0")
TURNS = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
MASSES = (300.0, 200.0, 150.0, 60.0, 30.0, 8.0)
CENTRES = ("0.2 0.03 0.1", "0.02 -0.1 0.6", "0.15 0.05 0.1", "-0.3 0 0.02", "0.05 0 0", "0.02 0 0")
INERTIAS = (
    (20.0, 18.0, 15.0, 1.0, -0.5, 0.3),
    (30.0, 31.0, 6.0, 0.4, 0.2, -0.6),
    (5.0, 9.0, 8.0, -0.3, 0.5, 0.1),
    (0.8, 3.0, 3.1, 0.05, 0.0, 0.02),
    (0.3, 0.25, 0.2, 0.0, 0.01, 0.0),
    (0.02, 0.03, 0.03, 0.0, 0.0, 0.001),
)
"""About the centres: xx, yy, zz, xy, xz, yz [kg m^2]."""
_TENSOR = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def inertial(mass, centre, tensor):
    """<inertial> of a link: mass [kg], centre [m] as text, tensor (6,) about it [kg m^2]."""
    values = " ".join(f'{key}="{value}"' for key, value in zip(_TENSOR, tensor, strict=True))
    return f'<inertial><origin xyz="{centre}"/><mass value="{mass}"/><inertia {values}/></inertial>'


def heavy_urdf(efforts=(4000.0, 4500.0, 3000.0, 800.0, 700.0, 400.0), without=None, last=""):
    """An arm of the size of a KR 500 whose links have inertias, but one link ``without``.

    ``last``: more elements, <joint> and <link>, behind the flange.
    """
    lines = ['<robot name="heavy"><link name="base"/>']
    parent = "base"
    for i, (xyz, axis) in enumerate(zip(PLACES, TURNS, strict=True), start=1):
        body = "" if i == without else inertial(MASSES[i - 1], CENTRES[i - 1], INERTIAS[i - 1])
        lines.append(f'<link name="l{i}">{body}</link>')
        text = joint(f"j{i}", "revolute", parent, f"l{i}", xyz, "0 0 0", axis, "-3 3 2")
        lines.append(text.replace('effort="1"', f'effort="{efforts[i - 1]}"'))
        parent = f"l{i}"
    lines.append('<link name="flange"/>')
    lines.append(joint("end", "fixed", parent, "flange", "0.05 0 0", "0 0 0"))
    return "\n".join([*lines, last, "</robot>"])
