"""DELMIA OLP XML: tasks, frames, arcs, profiles, and the size of large files."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.errors import ReadError
from postproc.model.toolpath import EventKind, MotionKind
from postproc.readers import ReadOptions, read


@pytest.fixture(scope="module")
def tasks(fixtures):
    return read(fixtures / "tasks.xml", options=ReadOptions(tool_axis=(0, 0, 1)))


def test_calls_are_followed_in_order(tasks):
    assert tasks.names == ("A1", "C.1", "C.3", "C.4", "A1")
    assert [o.name for o in tasks.operations] == ["Approach", "Cut", "Approach"]
    assert tasks.kind.tolist() == [
        MotionKind.JOINT, MotionKind.LINEAR, MotionKind.ARC, MotionKind.JOINT, MotionKind.JOINT,
    ]  # fmt: skip


def test_units_attributes_are_obeyed(tasks):
    np.testing.assert_allclose(tasks.points[0], [1.0, 0.0, 1.2])
    np.testing.assert_allclose(tasks.joints[0, :2], [0.25, -np.pi / 2])
    np.testing.assert_allclose(tasks.largest_blend, [np.nan, 0.0025, 0.0, 0.0, np.nan])


def test_object_frame_and_base_in_the_world(tasks):
    np.testing.assert_allclose(tasks.points[1], [0.5, 2.1, 0.5], atol=1e-12)
    truth = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_euler("x", 180, degrees=True)
    np.testing.assert_allclose(tasks.rotations[1], truth.as_matrix(), atol=1e-12)


def test_orientation_is_roll_about_z_pitch_about_y_yaw_about_x(read_text, fixtures):
    text = (fixtures / "tasks.xml").read_text()
    text = text.replace('Pitch="90" Roll="0" Units="deg" Yaw="0"',
                        'Pitch="121.2" Roll="18.0" Units="deg" Yaw="15.5"')  # fmt: skip
    toolpath = read_text(text, "a.xml", task="Approach")
    truth = Rotation.from_euler("ZYX", [18.0, 121.2, 15.5], degrees=True).as_matrix()
    np.testing.assert_allclose(toolpath.rotations[0], truth, atol=1e-12)


def test_tool_axis_of_the_cell_gives_the_axes(tasks):
    np.testing.assert_allclose(tasks.axes[0], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(tasks.axes[1], [0, 0, 1], atol=1e-12)


def test_circle_through_three_points(tasks):
    arcs = tasks.arcs
    np.testing.assert_allclose(arcs.centre[0], [0.6, 2.1, 0.5], atol=1e-9)
    np.testing.assert_allclose(arcs.normal[0], [0, 0, -1], atol=1e-12)
    assert arcs.radius[0] == pytest.approx(0.1)
    assert np.degrees(arcs.sweep[0]) == pytest.approx(180)


def test_speeds_of_profiles(tasks):
    assert np.isnan(tasks.feed[0])
    assert tasks.feed[1] == pytest.approx(0.01)
    assert tasks.feed[2] == pytest.approx(0.5 * 2.0), "half of the robot's maximum"


def test_joint_targets_have_no_point_and_say_so(tasks):
    assert np.isnan(tasks.points[3]).all()
    assert tasks.joints[3, 0] == pytest.approx(np.radians(10))
    assert {"DEL120", "DEL121"} == {finding.code for finding in tasks.warnings}


def test_other_activities_are_kept(tasks):
    unknown = [(e.index, e.text) for e in tasks.events if e.kind is EventKind.UNKNOWN]
    assert unknown == [(1, "DNBSetSignalActivity SetDO.1")]
    assert tasks.unknown_words == {"DNBSetSignalActivity": 1}
    changes = [(e.index, e.text) for e in tasks.events if e.kind is EventKind.TOOL_CHANGE]
    assert changes == [(1, "Spindle"), (4, "Default")]


def test_one_task_alone(fixtures):
    toolpath = read(fixtures / "tasks.xml", options=ReadOptions(task="Approach"))
    assert toolpath.names == ("A1",)
    assert toolpath.line.tolist() == [66]


def test_several_roots_are_joined_with_a_warning(fixtures, read_text):
    text = (fixtures / "tasks.xml").read_text()
    begin, end = text.index('    <ActivityList Task="Main">'), text.index(
        '    <ActivityList Task="Approach">')  # fmt: skip
    toolpath = read_text(text[:begin] + text[end:], "a.xml")
    assert toolpath.names == ("A1", "C.1", "C.3", "C.4")
    assert "DEL110" in {finding.code for finding in toolpath.warnings}


def test_an_unknown_profile_is_an_error(fixtures, read_text):
    text = (fixtures / "tasks.xml").read_text()
    with pytest.raises(ReadError) as caught:
        read_text(text.replace("<MotionProfile>Slow<", "<MotionProfile>Fast<"), "a.xml")
    assert caught.value.code == "DEL016"
    assert caught.value.source.line > 80


def test_entities_never_reach_the_parser(read_text, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("0.5")
    text = (
        f"<!DOCTYPE OLPData [<!ENTITY x SYSTEM 'file://{secret}'>]><OLPData><Resource>"
        "<GeneralInfo><MaxSpeed Units='m/s'>&x;</MaxSpeed></GeneralInfo></Resource></OLPData>"
    )
    with pytest.raises(ReadError) as caught:
        read_text(text, "a.xml")
    assert caught.value.code == "DEL002"
    late = "<OLPData>" + " " * 200_000 + "<!DOCTYPE x></OLPData>"
    with pytest.raises(ReadError):
        read_text(late, "b.xml")


def test_memory_does_not_grow_with_the_text(fixtures, tmp_path):
    text = (fixtures / "tasks.xml").read_text()
    begin = text.index('      <Activity ActivityType="DNBRobotMotionActivity" Operation="A.1"')
    end = text.index('    </ActivityList>\n    <ActivityList Task="Cut">')
    path = tmp_path / "large.xml"
    path.write_text(text[:begin] + text[begin:end] * 3000 + text[end:])
    tracemalloc.start()
    toolpath = read(path, options=ReadOptions(task="Approach"))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(toolpath) == 3000
    assert toolpath.line[-1] == 66 + 2999 * (text[begin:end].count("\n"))
    assert peak < 2 * path.stat().st_size


def test_a_move_of_another_type_is_not_lost(read_text):
    joint = "<Joint DOFNumber='1' Units='deg'><JointValue>90</JointValue></Joint>"
    text = (
        "<OLPData><Resource><GeneralInfo><DownloadCoordinates>Part</DownloadCoordinates>"
        "</GeneralInfo><ActivityList Task='T'><Activity ActivityType='MoveJointActivity'>"
        f"<ActivityName>Move.1</ActivityName><JointTarget>{joint}</JointTarget></Activity>"
        "</ActivityList></Resource></OLPData>"
    )
    toolpath = read_text(text, "a.xml")
    assert toolpath.kind.tolist() == [MotionKind.JOINT]
    assert toolpath.joints[0, 0] == pytest.approx(np.pi / 2)
    assert {"DEL111", "DEL121"} == {finding.code for finding in toolpath.warnings}
