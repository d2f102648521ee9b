"""Masses of URDF links, against pinocchio."""

import numpy as np
import pinocchio
import pytest

from postproc.cell.urdf.file import read_urdf_robot
from postproc.errors import CellError

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0.2 {i}" rpy="0 0 1"/>
<mass value="{mass}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="to_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0.3 -0.1 0.2" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""


def arm():
    parts = ['<robot name="arm">', LINK.format(name="world", i=0, mass=1)]
    parts.append(LINK.format(name="base", i=0, mass=5))
    parts.append(JOINT.format(child="base", parent="world", kind="fixed"))
    parent = "base"
    for i in range(1, 7):
        parts.append(LINK.format(name=f"l{i}", i=i / 10, mass=10 - i))
        parts.append(JOINT.format(child=f"l{i}", parent=parent, kind="revolute"))
        parent = f"l{i}"
    parts.append(LINK.format(name="cover", i=0.7, mass=2))
    parts.append(JOINT.format(child="cover", parent="l3", kind="fixed"))
    parts.append(LINK.format(name="flange", i=0.9, mass=1.5))
    parts.append(JOINT.format(child="flange", parent="l6", kind="fixed"))
    return "\n".join([*parts, "</robot>"])


def written(folder, text):
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def test_masses_include_what_is_fixed_to_a_link_as_in_pinocchio(tmp_path):
    path = written(tmp_path, arm())
    robot = read_urdf_robot(path)
    model = pinocchio.buildModelFromUrdf(str(path))
    wanted = [model.inertias[model.getJointId(f"to_l{i}")] for i in range(1, 7)]
    np.testing.assert_allclose(robot.link_mass, [inertia.mass for inertia in wanted])
    np.testing.assert_allclose(robot.link_com, [inertia.lever for inertia in wanted], atol=1e-12)
    assert robot.origins["link_mass"].provenance == "user"


def test_a_link_without_mass_leaves_all_masses_open(tmp_path):
    text = arm().replace('<mass value="6"/>', '<mass value="0"/>', 1)
    robot = read_urdf_robot(written(tmp_path, text))
    assert robot.link_mass is None
    assert "link_mass" not in robot.origins


@pytest.mark.parametrize("text", ["1 2", "x", "nan", ""])
def test_wrong_numbers_are_refused(tmp_path, text):
    wrong = arm().replace('<mass value="6"/>', f'<mass value="{text}"/>', 1)
    with pytest.raises(
        CellError, match=r"arm.urdf:\d+: error CEL011: <mass>: value is .*expected a finite number"
    ):
        read_urdf_robot(written(tmp_path, wrong))
