"""External axes of backups: frames held against chains multiplied here, with scipy's rotations."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.cell import load_cell
from postproc.collision.external import ExternalAxes
from postproc.jobs.controller_backup import compare_backup
from tests.backup import archives
from tests.backup.test_backup import BASES, cell_of, contents, run

FLOOR = (100.0, -200.0, 50.0, 90.0, 0.0, 0.0)
UP_450 = (0.0, 0.0, 450.0, 0.0, 90.0, 0.0)
TURNED_BACK = (0.0, 0.0, 0.0, 0.0, -90.0, 0.0)
RAIL = [
    "DECL EX_KIN $EX_KIN={ET1 #ERSYS,ET2 #NONE,ET3 #NONE,ET4 #NONE,ET5 #NONE,ET6 #NONE}",
    "DECL ET_AX $ET1_AX={TR_A1 #E1,TR_A2 #NONE,TR_A3 #NONE}", '$ET1_NAME[]="KL4000"',
    f"FRAME $ERSYSROOT={archives.frame(FLOOR)}", f"FRAME $ET1_TA1KR={archives.frame(UP_450)}",
    f"FRAME $ET1_TFLA3={archives.frame(TURNED_BACK)}", "$AXIS_TYPE[7]=1",
    "$SOFTN_END[7]=-100.0", "$SOFTP_END[7]=5900.0",
    "$RAT_MOT_AX[7]={N -35526926,D 1000000}", "$VEL_AXIS_MA[7]=3750.0",
]  # fmt: skip
ROOT = (20.903679, 1929.99133, 209.270615, 0.905965, -0.140198, -179.285088)
TO_E1 = (0.0, 0.0, 0.0, 0.0, 90.0, 0.0)
TO_E2 = (75.581, 2.737, -5.883, 90.42, 89.373, 89.674)
TO_FLANGE = (0.0, 0.0, 0.0, -90.0, 0.117, -179.898)
"""A measured turntable of two axes: RoboDK-API, UpdateKinematics_Turntable2x.py."""
TABLE = [
    "DECL EX_KIN $EX_KIN={ET1 #EASYS,ET2 #NONE,ET3 #NONE,ET4 #NONE,ET5 #NONE,ET6 #NONE}",
    "DECL ET_AX $ET1_AX={TR_A1 #E1,TR_A2 #E2,TR_A3 #NONE}", '$ET1_NAME[]="DKP400"',
    f"FRAME $ET1_TA1KR={archives.frame(TO_E1)}", f"FRAME $ET1_TA2A1={archives.frame(TO_E2)}",
    f"FRAME $ET1_TFLA3={archives.frame(TO_FLANGE)}", "$AXIS_TYPE[7]=3", "$AXIS_TYPE[8]=3",
    "$SOFTN_END[7]=-90.0", "$SOFTP_END[7]=90.0", "$SOFTN_END[8]=-185.0", "$SOFTP_END[8]=185.0",
    "$RAT_MOT_AX[7]={N 126,D 1}", "$VEL_AXIS_MA[7]=3000.0",
    "$RAT_MOT_AX[8]={N -100,D 1}", "$VEL_AXIS_MA[8]=2000.0",
]  # fmt: skip
ON_TABLE = [
    'MACHINE_DEF[1]={NAME[] "KR",COOP_KRC_INDEX 1,PARENT[] "WORLD",'
    f"ROOT {archives.frame((0.0,) * 6)},MECH_TYPE #ROBOT}}",
    'MACHINE_DEF[2]={NAME[] "DKP400",COOP_KRC_INDEX 1,PARENT[] "WORLD",'
    f"ROOT {archives.frame(ROOT)},MECH_TYPE #EASYS}}",
    'MACHINE_FRAME_DAT[3]={MACH_DEF_INDEX 2,PARENT[] "DKP400",GEOMETRY[] " "}',
]


def chained(*parts):
    """The product of frames (six numbers), turns (("turn", deg)) and slides (("slide", mm))."""
    T = np.eye(4)
    for part in parts:
        step = np.eye(4)
        if part[0] == "turn":
            step[:3, :3] = Rotation.from_euler("z", part[1], degrees=True).as_matrix()
        elif part[0] == "slide":
            step[2, 3] = part[1]
        else:
            step[:3, :3] = Rotation.from_euler("ZYX", part[3:], degrees=True).as_matrix()
            step[:3, 3] = part[:3]
        T = T @ step
    return T


def made(tmp_path, capsys, axes, lines, config=(), **more):
    machine = archives.machine(extra=[f"$EX_AX_NUM={axes}", *lines], **more)
    machine = machine.replace("INT $EX_AX_NUM=0\r\n", "")
    return cell_of(tmp_path, contents(machine, extra=config), capsys)


def in_mm(T):
    scaled = np.array(T)
    scaled[..., :3, 3] *= 1000.0
    return scaled


def test_a_rail_moves_the_root_as_its_chain_says(tmp_path, capsys):
    root = (7.0, 8.0, 9.0, 10.0, 0.0, 0.0)  # ignored where a rail is
    cell, data, _, _ = made(tmp_path, capsys, 1, RAIL, root=root)
    (axis,) = data["external_axes"]
    assert (axis["name"], axis["kind"], axis["range_mm"]) == ("E1", "rail", [-100.0, 5900.0])
    assert axis["speed_mm_s"] == pytest.approx(3750.0 / 60.0 / 35.526926 * 1000.0)
    positions = np.array([-100.0, 0.0, 1234.5, 5900.0])
    external = ExternalAxes(cell.external_axes, np.asarray(cell.robot.T_world_robroot))
    T_robroot_world = external.frames(positions[:, None] * 1e-3)[:, 0]
    for E1, T in zip(positions, T_robroot_world, strict=True):
        wanted = chained(FLOOR, UP_450, ("slide", E1), TURNED_BACK)
        np.testing.assert_allclose(in_mm(np.linalg.inv(T)), wanted, atol=1e-7)
    for base in cell.bases:
        wanted = np.linalg.inv(chained(FLOOR, UP_450, TURNED_BACK)) @ chained(BASES[base.number])
        np.testing.assert_allclose(in_mm(base.T_robroot_base), wanted, atol=1e-6)


def test_a_positioner_turns_its_base_as_its_chain_says(tmp_path, capsys):
    cell, data, text, _ = made(tmp_path, capsys, 2, TABLE, ON_TABLE)
    speeds = [axis["speed_deg_s"] for axis in data["external_axes"]]
    assert speeds == pytest.approx([3000.0 * 6.0 / 126.0, 120.0])
    (base,) = cell.bases
    assert base.number == 3
    assert "BASE 32" in text
    assert "stands still beside the positioner" in " ".join(text.replace("\n#", " ").split())
    external = ExternalAxes(cell.external_axes, np.asarray(cell.robot.T_world_robroot))
    for E1, E2 in ((0.0, 0.0), (-90.0, 0.0), (0.0, 185.0), (37.5, -112.25)):
        T_robroot_part = external.frames(np.deg2rad([[E1, E2]]))[0, 1]
        found = T_robroot_part @ np.asarray(cell.robot.T_world_robroot) @ base.T_robroot_base
        wanted = chained(ROOT, TO_E1, ("turn", E1), TO_E2, ("turn", E2), TO_FLANGE, BASES[3])
        np.testing.assert_allclose(in_mm(found), wanted, atol=1e-6)


@pytest.mark.parametrize(
    ("axes", "lines", "config", "words"),
    [
        (1, [*RAIL[:-1]], (), "the speed of E1 is not in the files"),
        (1, [line for line in RAIL if "SOFTP_END" not in line], (), "the soft limits of E1"),
        (1, [line for line in RAIL if "ERSYSROOT" not in line], (), "its place is not"),
        (1, [line.replace("TYPE[7]=1", "TYPE[7]=3") for line in RAIL], (), "linear axes alone"),
        (1, [line.replace("#ERSYS", "#ODD") for line in RAIL], (), "its kind is not known"),
        (1, RAIL[6:], (), "E1: E1 (linear, -100 to 5900 mm"),
        (2, TABLE, (), "its place is not in the files"),
        (2, TABLE, ON_TABLE[:2], "no base of the controller hangs on it"),
        (2, [line.replace("TYPE[8]=3", "TYPE[8]=5") for line in TABLE], ON_TABLE, "limits of E2"),
    ],
)
def test_what_the_files_do_not_say_is_a_comment(axes, lines, config, words, tmp_path, capsys):
    cell, data, text, _ = made(tmp_path, capsys, axes, lines, config)
    assert "external_axes" not in data
    assert words in " ".join(text.replace("\n#", " ").split())
    found = differences(cell.path, tmp_path / "backup.zip")
    assert "error" not in found.values()
    assert {f"external_axes[E{i + 1}]" for i in range(axes)} <= set(found)


DIFFERENT = [
    ("5900.0]", "5900.01]", "external_axes[E1].range_mm", "error"),
    ("5900.0]", "5800.0]", "external_axes[E1].range_mm", "note"),
    ("speed_mm_s = 1759", "speed_mm_s = 1859", "external_axes[E1].speed_mm_s", "warning"),
    ('axis = "+z"', 'axis = "-z"', "external_axes[E1].axis", "error"),
    ('name = "E1"', 'name = "E2"', "external_axes[E1]", "warning"),
    ('name = "E1"', 'name = "E2"', "external_axes[E2]", "error"),
]


def differences(cell, archive):
    """Return severities by key, as ``check --backup`` lists them."""
    comparison, _ = compare_backup(load_cell(cell), str(archive))
    return {d.key: str(d.severity) for d in comparison.differences}


def test_a_rail_that_differs_shows(tmp_path, capsys):
    cell, _, text, _ = made(tmp_path, capsys, 1, RAIL)
    archive = tmp_path / "backup.zip"
    code, out, _ = run(capsys, "check", cell.path, "--backup", archive, "--json")
    assert (code, json.loads(out)["backup"]["differences"]) == (0, [])
    head, mark, tail = text.partition("[[external_axes]]")
    wrong = []
    for old, new, key, severity in DIFFERENT:
        assert old in tail
        Path(cell.path).write_text(head + mark + tail.replace(old, new, 1))
        found = differences(cell.path, archive)
        wrong += [(old, new, found)] if found.get(key) != severity else []
    assert wrong == []
    code, _, _ = run(capsys, "check", cell.path, "--backup", archive, "--json")
    assert code == 1, "an error among them"


def test_a_positioner_beside_its_line_shows(tmp_path, capsys):
    cell, data, text, _ = made(tmp_path, capsys, 2, TABLE, ON_TABLE)
    x = data["external_axes"][1]["xyz_mm"][0]
    Path(cell.path).write_text(text.replace(f"[{x!r}, ", f"[{x + 0.5!r}, "))
    assert "external_axes[E2].axis" in differences(cell.path, tmp_path / "backup.zip")


def test_data_of_old_controllers_for_external_axes_do_not_hide_bases(tmp_path, capsys):
    """EX_AX_DATA[1..6] stand in every $config.dat of a KRC2, whatever it drives."""
    zero = archives.frame((0.0,) * 6, lower=True)
    extra = [
        f"EX_AX_DATA[{i}]={{ROOT {zero},EX_KIN #E{letter}SYS,OFFSET {zero}}}"
        for i, letter in enumerate("ABCDEF", 1)
    ]
    _, data, _, _ = cell_of(tmp_path, contents(extra=extra), capsys)
    assert [base["number"] for base in data["bases"]] == sorted(BASES)


OFFSET = (11.0, -7.0, 30.0, 15.0, 0.0, 0.0)


def old_base(index, root, offset, system="EASYS"):
    """EX_AX_DATA as a KRC2 writes it."""
    frames = [archives.frame(frame, lower=True) for frame in (root, offset)]
    return f"EX_AX_DATA[{index}]={{ROOT {frames[0]},EX_KIN #{system},OFFSET {frames[1]}}}"


def test_the_positioner_of_an_old_controller_has_its_root_in_the_external_bases(tmp_path, capsys):
    zero = (0.0,) * 6
    config = [old_base(1, ROOT, BASES[3]), old_base(2, ROOT, OFFSET), old_base(3, zero, zero)]
    cell, data, _, _ = made(tmp_path, capsys, 2, TABLE, config)
    assert [axis["name"] for axis in data["external_axes"]] == ["E1", "E2"]
    assert [base.number for base in cell.bases] == [17, 18]
    external = ExternalAxes(cell.external_axes, np.asarray(cell.robot.T_world_robroot))
    for E1, E2 in ((0.0, 0.0), (-90.0, 12.0), (37.5, -112.25)):
        T_robroot_part = external.frames(np.deg2rad([[E1, E2]]))[0, 1]
        for base, offset in zip(cell.bases, (BASES[3], OFFSET), strict=True):
            found = T_robroot_part @ np.asarray(cell.robot.T_world_robroot) @ base.T_robroot_base
            wanted = chained(ROOT, TO_E1, ("turn", E1), TO_E2, ("turn", E2), TO_FLANGE, offset)
            np.testing.assert_allclose(in_mm(found), wanted, atol=1e-6)


def test_external_bases_that_contradict_each_other_say_no_place(tmp_path, capsys):
    other = (*ROOT[:2], ROOT[2] + 1.0, *ROOT[3:])
    config = [old_base(1, ROOT, BASES[3]), old_base(2, other, OFFSET)]
    _, data, text, _ = made(tmp_path, capsys, 2, TABLE, config)
    assert "external_axes" not in data
    assert "its place is not in the files" in " ".join(text.replace("\n#", " ").split())
