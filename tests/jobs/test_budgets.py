"""Sizes that a file can blow up: each has a budget and one clear line."""

import numpy as np
import pytest

from postproc.cell.file import parse_cell
from postproc.cell.urdf.file import read_urdf_robot
from postproc.collision.mesh import MOST_TRIANGLES, load_mesh
from postproc.errors import CellError, PlanError
from postproc.geometry import abc_from_rotation
from postproc.kinematics.build import build
from postproc.planning.planner import plan
from tests.samples import apt_in, cell_in

HEAD = 'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'


def test_pecks(tmp_path):
    toolpath = apt_in(tmp_path)
    small = [type(c)(c.kind, c.depth, c.clearance, c.retract, 1e-8, 1e-8) for c in toolpath.cycles]
    from dataclasses import replace

    with pytest.raises(PlanError, match=r"demo.*PLN209.*pecks of 1e-05 mm in a hole"):
        plan(replace(toolpath, cycles=tuple(small)), cell_in(tmp_path))


@pytest.mark.slow
def test_turns_of_arcs(tmp_path):
    head = "UNITS/MM\nMULTAX/ON\nFEDRAT/300,MMPM\nGOTO/50,0,0,0,0,1\n"
    arc = "MOVARC/0,0,0,0,0,1,50,ANGLE,3600000\nGOTO/50,0,100,0,0,1\n"
    toolpath = apt_in(tmp_path, f"{head}{arc}FINI\n")
    cell = cell_in(tmp_path, old="[motion]\n", new="[motion]\narcs = 'lin'\nchord_mm = 0.001\n")
    with pytest.raises(PlanError, match=r"PLN211.*arcs make \d+ pieces, expected at most 1000000"):
        plan(toolpath, cell)


def test_triangles(tmp_path):
    count = MOST_TRIANGLES + 1
    file = tmp_path / "big.stl"
    with file.open("wb") as stream:
        stream.write(bytes(80) + count.to_bytes(4, "little"))
        stream.write(np.ones(50 * count, dtype=np.uint8).tobytes())
    with pytest.raises(CellError, match="COL009: 1000001 triangles"):
        load_mesh(file, 1e-3)


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("[optimize]\nstep_deg = 0.0001\n", "step_deg"),
        ("[motion]\nchord_mm = 1e-9\n", "chord_mm"),
        ("[[obstacles]]\nbox = { size_mm = [1e9, 1, 1] }\n", "size_mm"),
        ("[[obstacles]]\ncylinder = { radius_mm = 1e9, length_mm = 1 }\n", "radius_mm"),
    ],
)
def test_sizes_of_a_cell(table, key):
    with pytest.raises(CellError, match=key):
        parse_cell((HEAD + table).encode(), "cell.toml")


def urdf(name, axis="0 0 1", x=0.1):
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="{x} 0 0.3"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" velocity="2" effort="1"/></joint>'
        for i in range(6)
    )
    links = "".join(f'<link name="l{i}"/>' for i in range(7))
    return f'<robot name="{name}">{links}{joints}</robot>'


def test_an_axis_that_is_no_direction(tmp_path):
    file = tmp_path / "arm.urdf"
    for axis in ("0 0 0", "0 nan 1", "0 1"):
        file.write_text(urdf("arm", axis))
        with pytest.raises(CellError, match=r"axis is|axis>: xyz is"):
            read_urdf_robot(file)


def test_an_arm_of_a_known_name_that_is_another(tmp_path):
    from postproc.errors import KinematicsError

    file = tmp_path / "arm.urdf"
    file.write_text(urdf("kr210_r2700_2"))
    with pytest.raises(KinematicsError, match=r"KIN003.*off that of kuka_kr210_r2700_2"):
        build(read_urdf_robot(file))


def test_an_axis_of_a_known_arm_that_turns_the_other_way_is_named(tmp_path):
    from postproc.cell import find_robot, load_robot
    from postproc.errors import KinematicsError

    known = build(load_robot(find_robot("kuka_kr210_r2700_2")))
    chain = known.chain
    T_last = np.eye(4)
    for T in chain.placements[:6]:
        T_last = T_last @ T
    places = [*chain.placements[:6], np.linalg.inv(T_last) @ known.fk(np.zeros(6))]

    def text(signs):
        joints = ""
        for i, T in enumerate(places):
            xyz = " ".join(map(repr, T[:3, 3].tolist()))
            rpy = " ".join(map(repr, abc_from_rotation(T[:3, :3])[::-1].tolist()))
            axis = (np.asarray(chain.axes[i]) * signs[i]).tolist() if i < 6 else [0, 0, 1]
            joints += (
                f'<joint name="j{i}" type="{"revolute" if i < 6 else "fixed"}">'
                f'<parent link="l{i}"/><child link="l{i + 1}"/>'
                f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{" ".join(map(str, axis))}"/>'
                '<limit lower="-2" upper="2" velocity="2" effort="1"/></joint>'
            )
        links = "".join(f'<link name="l{i}"/>' for i in range(8))
        return f'<robot name="kr210_r2700_2">{links}{joints}</robot>'

    file = tmp_path / "arm.urdf"
    file.write_text(text([1, 1, 1, 1, 1, 1]))
    build(read_urdf_robot(file))
    file.write_text(text([-1, 1, 1, 1, 1, 1]))
    with pytest.raises(KinematicsError, match=r"KIN003.*: A1 of the file turns the other way"):
        build(read_urdf_robot(file))
