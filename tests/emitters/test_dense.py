"""Dense programs: what stands where, and that the numbers are those of the plan."""

import numpy as np
import pytest

from postproc.emitters.kuka.emitter import emit, render_files
from postproc.errors import EmitError, KrlError
from postproc.geometry.frames import rotation_angle, transform_from_kuka
from postproc.krl.text.names import NameAllocator
from postproc.krl.text.parse import parse_files
from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import EventKind
from postproc.units import DEG, MM

from . import plans, texts


def write(plan, **krl):
    return render_files(emit(plan, plans.cell(**krl)))


def drill(**changes):
    """One hole: entry, approach, plunge with dwell, retract."""
    return plans.plan(
        [
            {"kind": MoveKind.PTP},
            {"role": MoveRole.APPROACH, "blend_mm": 1.0, "speed": 0.5},
            {"role": MoveRole.PLUNGE, "blend_mm": 1.0, "speed": 0.002, "dwell": 0.3},
            {"role": MoveRole.RETRACT, "speed": 0.5},
        ],
        **changes,
    )


def test_a_whole_program():
    files = write(
        drill(
            events=[
                plans.event(0, EventKind.SPINDLE_ON, 50.0, "SPINDL/3000,CLW", 5),
                plans.event(4, EventKind.SPINDLE_OFF, 0.0, "SPINDL/OFF", 99),
            ]
        )
    )
    assert sorted(files) == ["TEST.dat", "TEST.src"]
    assert texts.lines(files, "TEST.src") == [
        "&ACCESS RVP",
        "&REL 1",
        "&PARAM EDITMASK = *",
        "&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe",
        "DEF TEST( )",
        "; input: part.cls",
        "; motions: 4",
        "; tool 1: X 107, Y 0, Z 362, A 0, B 0, C 0",
        "; base 2: X 1500, Y 0, Z 600, A 0, B 0, C 0",
        ";FOLD INI;%{PE}",
        ";FOLD BASISTECH INI",
        "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM()",
        "INTERRUPT ON 3",
        "BAS(#INITMOV,0)",
        ";ENDFOLD (BASISTECH INI)",
        ";ENDFOLD (INI)",
        ";FOLD TOOL 1, BASE 2, MOTION STATE;%{PE}",
        "BAS(#TOOL,1)",
        "BAS(#BASE,2)",
        "$IPO_MODE=#BASE",
        "$ADVANCE=3",
        "$ORI_TYPE=#VAR",
        "$CIRC_TYPE=#BASE",
        "$VEL.ORI1=200.0000",
        "$VEL.ORI2=200.0000",
        "$APO.CPTP=100",
        "$APO.CORI=5.0000",
        ";ENDFOLD (MOTION STATE)",
        "PP_SPINDLE_ON(3000) ; CAM line 5: SPINDL/3000,CLW",
        "BAS(#VEL_PTP,50)",
        "PTP {A1 10.00000,A2 -95.50000,A3 100.25000,A4 5.00000,A5 40.00000,A6 -3.50000} "
        "; CAM line 100",
        "$VEL.CP=0.500000",
        "LIN {X 10.0000,Y 0.0000,Z 0.0000,A 0.00000,B 90.00000,C 0.00000} ; CAM line 101",
        "$VEL.CP=0.002000",
        "LIN {X 20.0000,Y 0.0000,Z 0.0000,A 0.00000,B 90.00000,C 0.00000} ; CAM line 102",
        "WAIT SEC 0.3000 ; CAM line 102",
        "$VEL.CP=0.500000",
        "LIN {X 30.0000,Y 0.0000,Z 0.0000,A 0.00000,B 90.00000,C 0.00000} ; CAM line 103",
        "PP_SPINDLE_OFF() ; CAM line 99: SPINDL/OFF",
        "END",
    ]


def test_files_are_ascii_with_cr_lf_and_a_final_newline():
    for content in write(plans.milling()).values():
        text = content.decode("ascii")
        assert text.endswith("\r\n")
        assert text.count("\n") == text.count("\r\n") == text.count("\r")


def test_printed_poses_are_the_plan_to_a_tenth_of_a_micrometre():
    rng = np.random.default_rng(5)
    moves = [{"kind": MoveKind.PTP}]
    for _ in range(300):
        b = rng.choice([rng.uniform(-90, 90), 90.0, -90.0])
        moves.append(
            {
                "xyz_mm": rng.uniform(-3000, 3000, 3),
                "abc_deg": (rng.uniform(-180, 180), b, rng.uniform(-180, 180)),
                "q_deg": rng.uniform(-180, 180, 6),
            }
        )
    plan = plans.plan(moves)
    lines = texts.motions(write(plan), "TEST.src")
    rows = np.array([texts.numbers(line) for line in lines])
    assert np.abs(rows[0] * DEG - plan.q[0]).max() < 1e-7
    T = transform_from_kuka(rows[1:, :3], rows[1:, 3:6])
    assert np.abs(T[:, :3, 3] - plan.T_base_tcp[1:, :3, 3]).max() < 0.51e-4 * MM
    turned = rotation_angle(T[:, :3, :3], plan.T_base_tcp[1:, :3, :3])
    assert turned.max() < 2e-5 * DEG


def test_what_is_modal_is_written_when_it_changes():
    moves = [{"kind": MoveKind.PTP}]
    moves += [{"speed": s, "blend_mm": b} for s, b in ((0.1, 1), (0.1, 1), (0.2, 1), (0.2, 2))]
    moves += [{"speed": 0.2}]
    text = texts.code(write(plans.plan(moves)), "TEST.src")
    settings = [line for line in text if line.startswith(("$VEL.CP", "$APO.CDIS"))]
    assert settings == [
        "$VEL.CP=0.100000",
        "$APO.CDIS=1.0000",
        "$VEL.CP=0.200000",
        "$APO.CDIS=2.0000",
    ]


def test_arcs_stay_arcs():
    moves = [
        {"kind": MoveKind.PTP},
        {"kind": MoveKind.CIRC, "xyz_mm": (100, 0, 0), "aux_mm": (50, 50, 0)},
        {"kind": MoveKind.CIRC, "xyz_mm": (200, 0, 0), "aux_mm": (150, 1e-4, 0)},
    ]
    text = texts.motions(write(plans.plan(moves)), "TEST.src")
    assert text[1] == (
        "CIRC {X 50.0000,Y 50.0000,Z 0.0000,A 0.00000,B 90.00000,C 0.00000},"
        "{X 100.0000,Y 0.0000,Z 0.0000,A 0.00000,B 90.00000,C 0.00000}"
    )
    assert text[2].startswith("LIN")  # rises 0.1 um over 100 mm: printed, no circle


def test_orientation_at_the_middle_of_an_arc_is_half_way():
    moves = [
        {"kind": MoveKind.PTP, "abc_deg": (0, 0, 0)},
        {
            "kind": MoveKind.CIRC,
            "xyz_mm": (100, 0, 0),
            "aux_mm": (50, 50, 0),
            "abc_deg": (60, 0, 0),
        },
    ]
    text = texts.motions(write(plans.plan(moves)), "TEST.src")
    assert "Y 50.0000,Z 0.0000,A 30.00000,B 0.00000,C 0.00000}" in text[1]


@pytest.mark.parametrize("end", [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0)])
def test_three_points_that_make_no_arc_are_refused(end):
    moves = [
        {"kind": MoveKind.PTP},
        {"kind": MoveKind.CIRC, "xyz_mm": end, "aux_mm": (150, 0, 0)},
    ]
    with pytest.raises(EmitError) as caught:
        write(plans.plan(moves))
    assert caught.value.code == "EMT313"
    assert caught.value.source.line == 101


@pytest.mark.parametrize(
    ("move", "code"),
    [
        ({"speed": 0.0}, "EMT311"),
        ({"speed": float("nan")}, "EMT311"),
        ({"speed": 5.0}, "EMT312"),
        ({"kind": MoveKind.PTP, "ptp": 0.0}, "EMT311"),
        ({"kind": MoveKind.PTP, "ptp": 1.5}, "EMT311"),
    ],
)
def test_speeds_that_cannot_be_written_are_refused(move, code):
    with pytest.raises(EmitError) as caught:
        write(plans.plan([{"kind": MoveKind.PTP}, move]))
    assert caught.value.code == code


def test_a_rapid_above_the_limit_is_slowed_down():
    moves = [{"kind": MoveKind.PTP}, {"role": MoveRole.RAPID, "speed": 9.0}]
    assert "$VEL.CP=2.000000" in texts.code(write(plans.plan(moves)), "TEST.src")


def test_not_a_number_in_a_pose_is_refused():
    moves = [{"kind": MoveKind.PTP}, {"xyz_mm": (float("nan"), 0, 0)}]
    with pytest.raises(KrlError) as caught:
        write(plans.plan(moves))
    assert caught.value.code == "KRL901"


def test_a_plan_must_begin_with_a_ptp():
    for moves in ([{}], []):
        with pytest.raises(EmitError) as caught:
            write(plans.plan(moves))
        assert caught.value.code == "EMT310"


@pytest.mark.parametrize("kind", ["rail", "positioner"])
def test_external_axes_stand_in_every_point(kind):
    moves = [{"kind": MoveKind.PTP, "external": (0.5,)}, {"external": (-0.25,)}]
    cell = plans.with_axis(plans.cell(), "E2", kind)
    files = render_files(emit(plans.plan(moves), cell))
    first, second = texts.motions(files, "TEST.src")
    factor = 1000.0 if kind == "rail" else 180.0 / np.pi
    assert f",E1 0.00000,E2 {0.5 * factor:.5f}}}" in first
    assert f",E1 0.00000,E2 {-0.25 * factor:.5f}}}" in second
    coupled = "BAS(#FRAMES,0)" in texts.code(files, "TEST.src")
    assert coupled == (kind == "positioner")


def test_axes_that_the_cell_does_not_have_are_refused():
    with pytest.raises(EmitError) as caught:
        write(plans.plan([{"kind": MoveKind.PTP, "external": (0.5,)}]))
    assert caught.value.code == "EMT314"


def test_a_compensated_program_says_so():
    plan = plans.milling(compensation_note="shifted by the model of today; max 0.4 mm\nHALT")
    lines = texts.lines(write(plan), "TEST.src")
    assert "; shifted by the model of today, max 0.4 mm HALT" in lines


def test_every_motion_names_its_cam_line():
    files = write(plans.milling(3))
    named = [line for line in texts.lines(files, "TEST.src") if texts.MOTION.match(line)]
    assert [line.partition(";")[2] for line in named] == [f" CAM line {100 + i}" for i in range(4)]
    bare = write(plans.milling(3), cam_lines=False)
    assert not any("CAM line" in line for line in texts.lines(bare, "TEST.src"))


def test_operations_are_folds():
    path = plans.toolpath(7, operations=("rough", "finish"), operation=[0, 0, 0, 0, 1, 1, 1])
    lines = texts.lines(write(plans.milling(path=path)), "TEST.src")
    folds = [line for line in lines if "OPERATION" in line]
    assert folds == [
        ";FOLD OPERATION 1: rough (CAM line 10);%{PE}",
        ";ENDFOLD (OPERATION 1)",
        ";FOLD OPERATION 2: finish (CAM line 11);%{PE}",
        ";ENDFOLD (OPERATION 2)",
    ]


def test_the_reader_gives_back_the_modules():
    for krl in ({}, {"max_points_per_file": 3}, {"setup": True, "hooks_example": True}):
        modules = emit(plans.milling(), plans.cell(**krl))
        files = render_files(modules)
        read = parse_files(files)
        assert read == modules
        assert render_files(read) == files


def test_programs_of_a_batch_have_different_names():
    names = NameAllocator()
    cell = plans.cell(max_points_per_file=3)
    written = [emit(plans.milling(name="A b"), cell, names=names) for _ in range(3)]
    all_names = [module.name.upper() for modules in written for module in modules]
    assert len(set(all_names)) == len(all_names)
    assert names.changes == (("A b", "A_b"), ("A b", "A_b_2"), ("A b", "A_b_3"))


def test_moves_that_serve_no_tag_name_no_line():
    moves = [{"kind": MoveKind.PTP, "tag": -1}, {"tag": 0}, {"kind": MoveKind.PTP, "tag": -1}]
    path = plans.toolpath(1, operations=("only",))
    lines = texts.lines(write(plans.plan(moves, path=path)), "TEST.src")
    found = [line for line in lines if texts.MOTION.match(line) or "OPERATION" in line]
    assert [line.partition(";")[2][:10] for line in found] == [
        "",
        "FOLD OPERA",
        " CAM line ",
        "ENDFOLD (O",
        "",
    ]
