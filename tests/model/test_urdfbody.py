"""Masses and solids of URDF links, against pinocchio and by hand."""

import numpy as np
import pinocchio
import pytest

from postproc.errors import CellError
from postproc.model.urdffile import read_urdf_robot

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0.2 {i}" rpy="0 0 1"/>
<mass value="{mass}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{extra}</link>"""
JOINT = """<joint name="to_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0.3 -0.1 0.2" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""
SOLIDS = """
<collision><origin xyz="0 0 0.5"/><geometry><box size="1 2 3"/></geometry></collision>
<collision><geometry><sphere radius="0.2"/></geometry></collision>
<collision><geometry><cylinder radius="0.1" length="0.7"/></geometry></collision>
<collision><geometry>
<mesh filename="package://arm_support/meshes/a.stl" scale="0.01 0.01 0.01"/>
</geometry></collision>
<collision><geometry><mesh filename="package://arm_support/meshes/b.dae"/></geometry></collision>
"""


def arm(extra=""):
    parts = ['<robot name="arm">', LINK.format(name="world", i=0, mass=1, extra="")]
    parts.append(LINK.format(name="base", i=0, mass=5, extra=extra))
    parts.append(JOINT.format(child="base", parent="world", kind="fixed"))
    parent = "base"
    for i in range(1, 7):
        own = extra if i in (3, 6) else ""
        parts.append(LINK.format(name=f"l{i}", i=i / 10, mass=10 - i, extra=own))
        parts.append(JOINT.format(child=f"l{i}", parent=parent, kind="revolute"))
        parent = f"l{i}"
    parts.append(LINK.format(name="cover", i=0.7, mass=2, extra=""))
    parts.append(JOINT.format(child="cover", parent="l3", kind="fixed"))
    parts.append(LINK.format(name="flange", i=0.9, mass=1.5, extra=extra))
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


def test_collision_solids_are_found_placed_and_scaled(tmp_path):
    folder = tmp_path / "arm_support" / "urdf"
    (tmp_path / "arm_support" / "meshes").mkdir(parents=True)
    folder.mkdir()
    mesh = tmp_path / "arm_support" / "meshes" / "a.stl"
    mesh.write_bytes(b"solid\nendsolid\n")
    robot = read_urdf_robot(written(folder, arm(SOLIDS)))
    links = [link for link, _ in robot.link_meshes]
    assert sorted(links) == [0] * 4 + [3] * 4 + [6] * 8
    box, ball, tube, file = [solid for link, solid in robot.link_meshes if link == 3]
    np.testing.assert_allclose(box.size, [1, 2, 3])
    np.testing.assert_allclose(box.T_owner_mesh[:3, 3], [0, 0, 0.5])
    assert (ball.radius, ball.length) == (0.2, 0.4)
    assert (tube.radius, tube.length) == (0.1, 0.7)
    assert (file.file, file.scale) == (mesh, 0.01)
    assert "b.dae" in robot.origins["link_meshes"].source


@pytest.mark.parametrize("text", ["1 2", "1 2 x", "1 2 nan"])
def test_wrong_numbers_are_refused(tmp_path, text):
    with pytest.raises(
        CellError, match=r"arm.urdf:1: error CEL011: <box>: size is .* expected 3 numbers"
    ):
        read_urdf_robot(written(tmp_path, arm(SOLIDS.replace("1 2 3", text))))
