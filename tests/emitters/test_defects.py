"""One test per defect that other postprocessors are known for, read from their code and reports.

What each test looks at is the text, with regular expressions only.
"""

import re

import numpy as np
import pytest

from postproc.emitters.kuka.emitter import emit, render_files
from postproc.errors import EmitError
from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import EventKind
from postproc.units import MM_PER_MIN

from . import plans, texts

STYLES = [
    {},
    {"points": "dat"},
    {"motion": "spline"},
    {"motion": "spline_block", "points": "dat"},
    {"motion": "forms", "kss": "8.5"},
    {"motion": "forms", "kss": "8.6"},
    {"max_points_per_file": 4},
    {"max_points_per_file": 4, "motion": "spline_block"},
    {"max_points_per_file": 4, "motion": "forms"},
]


def write(plan, **krl):
    return render_files(emit(plan, plans.cell(**krl)))


def job(**changes):
    """An entry, a cut, two holes with dwell, an arc."""
    moves = [
        {"kind": MoveKind.PTP},
        {"role": MoveRole.RAPID, "speed": 0.5, "blend_mm": 2.0},
        {"role": MoveRole.APPROACH, "speed": 0.5, "blend_mm": 2.0},
        {"role": MoveRole.PLUNGE, "speed": 0.002, "blend_mm": 2.0, "dwell": 0.25},
        {"role": MoveRole.RETRACT, "speed": 0.5, "blend_mm": 2.0},
        {"role": MoveRole.RAPID, "speed": 0.5, "blend_mm": 2.0},
        {"role": MoveRole.CUT, "blend_mm": 1.0},
        {"role": MoveRole.CUT, "blend_mm": 1.0},
        {
            "role": MoveRole.CUT,
            "kind": MoveKind.CIRC,
            "xyz_mm": (80, 20, 0),
            "aux_mm": (78, 10, 2),
            "blend_mm": 1.0,
        },
        {"role": MoveRole.CUT, "blend_mm": 1.0},
        {"kind": MoveKind.PTP, "role": MoveRole.RAPID},
    ]
    return plans.plan(moves, **changes)


# ------------------------------------------------------------------------------ numbers, speeds


@pytest.mark.parametrize("feed", [1.0, 20.0, 100.0, 299.0, 301.0, 600.0, 12345.6])
@pytest.mark.parametrize("motion", ["dense", "spline", "spline_block", "forms"])
def test_slow_feeds_are_not_rounded_away(feed, motion):
    """Two decimals of m/s print every feed below 300 mm/min as 0.00."""
    moves = [{"kind": MoveKind.PTP}] + [{"speed": feed * MM_PER_MIN, "blend_mm": 1}] * 3
    text = "\n".join(texts.code(write(plans.plan(moves), motion=motion), "TEST.src"))
    speeds = [float(v) for v in re.findall(r"\$VEL\.CP=(\S+)", text)]
    assert speeds
    assert all(abs(v / (feed * MM_PER_MIN) - 1.0) < 1e-3 for v in speeds)


@pytest.mark.parametrize("kss", ["5", "8.3", "8.5", "8.6", "8.7"])
def test_the_speed_of_a_form_is_the_same_in_all_its_texts(kss):
    """A post that prints BAS(#CP_PARAMS) without decimals turns 0.05 m/s into 0."""
    moves = [{"kind": MoveKind.PTP, "ptp": 0.3}, {"role": MoveRole.APPROACH, "speed": 0.05}]
    files = write(plans.plan(moves), motion="forms", kss=kss)
    text = files["TEST.src"].decode()
    data = files["TEST.dat"].decode()
    visible = re.findall(r"FOLD LIN \S+ Vel=(\S+) m/s", text)
    hidden = re.findall(r"LIN, 2:\S+, 3:, 5:([\d.]+)" if kss < "8.6" else r"Path=([\d.]+)", text)
    coded = re.findall(r"BAS\(#CP_PARAMS,(\S+)\)", text)
    stored = re.findall(r"LCPDAT\d+={VEL ([\d.]+)", data)
    values = [float(v) for v in (*visible, *hidden, *coded, *stored)]
    assert len(values) == 4
    assert all(value == pytest.approx(0.05, rel=1e-9) for value in values)
    percents = re.findall(r"Vel=(\S+) %|5:(\d+), 7:PD|VelocityPtp=(\d+)", text)
    assert {part for found in percents for part in found if part} == {"30"}


@pytest.mark.parametrize("krl", STYLES)
def test_no_number_is_nan_minus_zero_or_an_exponent(krl):
    plan = job()
    tiny = plan.T_base_tcp.copy()
    tiny[:, 1, 3] = -1e-12
    tiny[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    plan = job(T_base_tcp=tiny)
    for content in write(plan, **krl).values():
        text = content.decode()
        code = "\n".join(line.partition(";")[0] for line in text.split("\r\n"))
        assert not re.search(r"\bnan\b|\binf\b|-0\.0*(?!\d)|\d[eE][+-]?\d|\d,\d", code)


@pytest.mark.parametrize("krl", STYLES)
def test_approximation_of_ptp_is_in_percent_and_of_paths_in_mm(krl):
    """Millimetres in $APO.CPTP, or degrees per second in $VEL.ORI1, are another post's bug."""
    for name in texts.sources(files := write(job(), **krl)):
        text = "\n".join(texts.code(files, name))
        assert set(re.findall(r"\$APO\.CPTP=(\S+)", text)) <= {"100"}
        assert set(re.findall(r"\$VEL\.ORI[12]=(\S+)", text)) <= {"200.0000"}
        assert not re.search(r"\$VEL_AXIS\[|\$VEL_EXTAX\[|\$VEL=", text)


# -------------------------------------------------------------------------------- first motions


@pytest.mark.parametrize("krl", STYLES)
def test_every_file_begins_with_a_complete_ptp(krl):
    """A first LIN, `PTP $AXIS_ACT` or a pose without status and turn leaves the posture open."""
    files = write(job(), **krl)
    forms = krl.get("motion") == "forms"
    for name in texts.sources(files):
        found = texts.motions(files, name)
        if not found:
            continue
        target = found[0].split(maxsplit=1)
        assert target[0] in ("PTP", "SPTP")
        if krl.get("points") == "dat" or forms:
            data = files[name.replace(".src", ".dat")].decode()
            if (declared := re.search(rf" {target[1]}={{(.*)}}", data)) is not None:
                target[1] = declared.group(1)
        wanted = r"A1 .*A2 .*A3 .*A4 .*A5 .*A6 |X .*Y .*Z .*A .*B .*C .*S \d+,T \d+"
        assert re.search(wanted, target[1])
        assert "AXIS_ACT" not in found[0]


@pytest.mark.parametrize("motion", ["dense", "forms"])
def test_status_and_turn_are_those_of_the_planned_joints(motion):
    """A fixed S and T, or none, sends the robot into another posture."""
    rng = np.random.default_rng(3)
    moves = [{"kind": MoveKind.PTP, "q_deg": q} for q in rng.uniform(-100, 100, (40, 6))]
    files = write(plans.plan(moves), motion=motion, points="dat")
    data = re.findall(r"DECL E6POS .*,S (\d+),T (\d+)}", files["TEST.dat"].decode())
    if motion == "dense":
        assert not data
        assert files["TEST.dat"].decode().count("DECL E6AXIS XP") == 40
        return
    assert len(data) == 40
    for (status, turn), move in zip(data, moves, strict=True):
        signs = [angle < 0.0 for angle in move["q_deg"]]
        assert int(turn) == sum(1 << i for i, negative in enumerate(signs) if negative)
        assert (int(status) >> 2) & 1 == signs[4]
        assert int(status) < 8


# ------------------------------------------------------------------------- tool, base, INI, load


@pytest.mark.parametrize("krl", STYLES)
def test_tool_and_base_are_set_with_the_load_and_after_initmov(krl):
    """`$TOOL={...}` leaves $LOAD behind; INITMOV resets tool and base to 1 and 0."""
    files = write(job(), **krl)
    main, *subs = texts.sources(files)
    text = texts.code(files, main)
    assert text.index("BAS(#INITMOV,0)") < text.index("BAS(#TOOL,1)") < text.index("BAS(#BASE,2)")
    first = next((i for i, line in enumerate(text) if texts.MOTION.match(line)), len(text))
    assert text.index("BAS(#BASE,2)") < first
    assert text.count("INTERRUPT ON 3") == 1
    for name in subs:
        sub = texts.code(files, name)
        assert not any("INITMOV" in line or "INTERRUPT" in line for line in sub)
        assert "BAS(#TOOL,1)" in sub
    for name in (main, *subs):
        assert not any(re.match(r"\$(TOOL|BASE|LOAD)\b", line) for line in texts.code(files, name))


def test_load_data_are_those_of_the_cell():
    """No mass is made up; an inertia that is not known is that of a point, and is named."""
    text = write(job(), setup=True)["TEST_SETUP.src"].decode()
    assert "LOAD_DATA[1]=" not in text
    assert "; enter by hand: not known mass, centre of gravity" in text
    cell = plans.heavy(plans.cell(setup=True))
    text = render_files(emit(job(), cell))["TEST_SETUP.src"].decode()
    assert "LOAD_DATA[1]={M 120.0000,CM {X 0.0000,Y 0.0000,Z 180.0000," in text
    assert "; the inertia is not known: as of a mass in one point" in text
    cell = plans.heavy(plans.cell(setup=True), np.array([1.0, 2.0, 3.5]))
    text = render_files(emit(job(), cell))["TEST_SETUP.src"].decode()
    load = (
        "LOAD_DATA[1]={M 120.0000,CM {X 0.0000,Y 0.0000,Z 180.0000,A 0.00000,B 0.00000,C 0.00000},"
        "J {X 1.0000,Y 2.0000,Z 3.5000}}"
    )
    assert load in text


def test_frames_are_written_only_where_asked_for():
    for name, content in write(job(), setup=True).items():
        found = re.search(r"TOOL_DATA|BASE_DATA|LOAD_DATA", content.decode())
        assert (found is not None) == (name == "TEST_SETUP.src")


# ---------------------------------------------------------------------------------- approximation


@pytest.mark.parametrize("krl", STYLES)
def test_exact_where_it_must_be(krl):
    """A blended plunge does not reach its depth; a blended last point is never reached."""
    files = write(job(), **krl)
    exact, following = [], {}
    for name in texts.sources(files):
        found = texts.code(files, name)
        moves = [i for i, line in enumerate(found) if texts.MOTION.match(line)]
        for i in moves:
            blended = re.search(r" C_\w+$", found[i]) is not None
            following[found[i]] = found[i + 1] if i + 1 < len(found) else ""
            exact += [] if blended else [found[i]]
        if moves:
            in_block = any(line.startswith("ENDSPLINE") for line in found[moves[-1] :])
            assert found[moves[-1]] in exact or in_block
    waits = [line for line, after in following.items() if after.startswith("WAIT SEC")]
    assert len(waits) == 1
    assert waits[0] in exact
    assert sum(content.count(b"WAIT SEC") for content in files.values()) == 1


def test_exact_around_contact_and_strokes():
    marks = [bool(re.search("C_DIS$", line)) for line in texts.motions(write(job()), "TEST.src")]
    #        PTP    rapid  appr.  plunge retr.  rapid  cut   cut   arc   cut    PTP
    assert marks == [False, True, False, False, True, False, True, True, True, False, False]


def test_no_approximation_takes_more_than_its_share_of_a_short_segment():
    """$APO.CDIS beyond half of a segment is cut by the controller, or the blend is refused."""
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.uniform(0.05, 8.0, 400))
    moves = [{"kind": MoveKind.PTP}]
    moves += [{"xyz_mm": (v, 0.0, 0.0), "blend_mm": 2.0} for v in x]
    text = texts.code(write(plans.plan(moves)), "TEST.src")
    distance, before, limits = 0.0, None, []
    for line in text:
        if line.startswith("$APO.CDIS"):
            distance = float(line.partition("=")[2])
        elif line.startswith("LIN"):
            here = texts.numbers(line)[0]
            if before is not None:
                limits.append((before[1], here - before[0]))
            before = (here, distance if line.endswith("C_DIS") else 0.0)
    segments = np.diff(x)
    blends = np.array([blend for blend, _ in limits])
    assert (blends[1:] <= 0.451 * np.minimum(segments[:-1], segments[1:])).all()
    assert (blends > 0.0).mean() > 0.95
    settings = sum(line.startswith("$APO.CDIS") for line in text)
    assert settings < 0.7 * len(x)  # not one line per point


@pytest.mark.parametrize(("motion", "word"), [("dense", "C_DIS"), ("spline", "C_SPL")])
def test_ptp_is_approximated_by_distance(motion, word):
    """C_PTP with 50 % begins to leave a long PTP half a metre before its end."""
    moves = [{"kind": MoveKind.PTP, "role": MoveRole.RAPID, "blend_mm": 5.0}] * 2
    moves += [{"role": MoveRole.RAPID, "speed": 0.5}]
    text = texts.code(write(plans.plan(moves), motion=motion), "TEST.src")
    assert text.index("$APO.CDIS=4.0000") > 0  # at most 0.45 of 10 mm, rounded down
    assert all(line.endswith(f"}} {word}") for line in text if line.startswith(("PTP", "SPTP")))
    assert "C_PTP" not in " ".join(text)


def test_orientation_only_moves_end_exactly():
    moves = [{"kind": MoveKind.PTP}]
    moves += [{"xyz_mm": p, "blend_mm": 1.0} for p in ((9, 0, 0), (9, 0, 0), (20, 0, 0))]
    text = texts.motions(write(plans.plan(moves)), "TEST.src")
    assert not any(line.endswith("C_DIS") for line in text)


# ------------------------------------------------------------------------------- nothing vanishes

EVENTS = [
    (EventKind.SPINDLE_ON, 100.0, "PP_SPINDLE_ON(6000)"),
    (EventKind.SPINDLE_ON, -100.0, "PP_SPINDLE_ON(-6000)"),
    (EventKind.SPINDLE_OFF, 0.0, "PP_SPINDLE_OFF()"),
    (EventKind.COOLANT_ON, 0.0, "PP_COOLANT_ON(1)"),
    (EventKind.COOLANT_OFF, 0.0, "PP_COOLANT_OFF()"),
    (EventKind.STOP, 0.0, "PP_STOP()"),
    (EventKind.OPTIONAL_STOP, 0.0, "PP_OPTIONAL_STOP()"),
    (EventKind.TOOL_CHANGE, 12.0, "PP_TOOL_CHANGE(12)"),
    (EventKind.DWELL, 1.5, "WAIT SEC 1.5000"),
]


@pytest.mark.parametrize(("kind", "value", "line"), EVENTS)
@pytest.mark.parametrize("krl", STYLES)
@pytest.mark.parametrize("index", [0, 4, 8, 11])
def test_events_are_instructions_not_comments(kind, value, line, krl, index):
    """Dwells that vanish, spindles that are only a comment: the cutter stands still."""
    files = write(job(events=[plans.event(index, kind, value)]), **krl)
    found = [text for name in texts.sources(files) for text in texts.code(files, name)]
    assert sum(line in text for text in found) == 1


@pytest.mark.parametrize("kind", [EventKind.UNKNOWN, EventKind.MESSAGE])
def test_unknown_statements_and_messages_stay_visible(kind):
    files = write(job(events=[plans.event(3, kind, 0.0, "CLAMP/3,ON", 55)]))
    word = "not converted" if kind is EventKind.UNKNOWN else "message"
    assert f"; CAM line 55: {word}: CLAMP/3,ON" in texts.lines(files, "TEST.src")


def test_a_dwell_too_short_to_print_is_refused():
    with pytest.raises(EmitError) as caught:
        write(job(events=[plans.event(3, EventKind.DWELL, 1e-5, line=12)]))
    assert str(caught.value).startswith("part.cls:12: error EMT315: a dwell [s] of 1e-05 would be")
    with pytest.raises(EmitError, match="EMT315"):
        write(plans.plan([{"kind": MoveKind.PTP}, {"dwell": 2e-5}]))


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_spindle_speed_that_is_none_is_refused(value):
    with pytest.raises(EmitError, match="EMT315"):
        write(job(events=[plans.event(3, EventKind.SPINDLE_ON, value)]))


# -------------------------------------------------------- stops of the advance run in the material


def cut(*events):
    moves = [{"kind": MoveKind.PTP}] + [{"blend_mm": 1.0}] * 5
    for i, move in enumerate(moves):
        moves[i] = {**move, "xyz_mm": (10.0 * i, 0, 0)}
    return plans.plan(moves, events=events)


@pytest.mark.parametrize(
    ("motion", "trigger"),
    [
        ("dense", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO {} PRIO=-1"),
        ("spline", "TRIGGER WHEN PATH=0 ONSTART DELAY=0 DO {} PRIO=-1"),
        ("spline_block", "TRIGGER WHEN PATH=0 ONSTART DELAY=0 DO {} PRIO=-1"),
    ],
)
def test_coolant_in_a_cut_does_not_stop_the_robot(motion, trigger):
    on = plans.event(3, EventKind.COOLANT_ON, 0.0, "MIST")
    text = texts.code(write(cut(on), motion=motion), "TEST.src")
    at = text.index(trigger.format("PP_COOLANT_ON(2)"))
    assert texts.MOTION.match(text[at + 1])
    if motion == "dense":
        assert all(line.endswith("C_DIS") for line in text if line.startswith("LIN")) is False
        assert text[at - 1].endswith("C_DIS")


def test_a_change_of_the_spindle_stops_the_robot():
    start = plans.event(0, EventKind.SPINDLE_ON, 100.0)
    change = plans.event(3, EventKind.SPINDLE_ON, 200.0)
    text = texts.code(write(cut(start, change)), "TEST.src")
    assert "PP_SPINDLE_ON(6000)" in text
    at = text.index("PP_SPINDLE_ON(12000)")
    assert not text[at - 1].endswith("C_DIS")
    text = texts.code(write(cut(change)), "TEST.src")
    at = text.index("PP_SPINDLE_ON(12000)")
    assert not text[at - 1].endswith("C_DIS")


# --------------------------------------------------------------------------- names, headers, data


@pytest.mark.parametrize("name", ["x" * 60, "FREEFORM (rev+2) Nr. 7", "2D Kontur", "LIN", "bas"])
@pytest.mark.parametrize("krl", STYLES)
def test_names_are_legal_with_everything_that_is_put_around_them(name, krl):
    """24 characters for sub-programs and points as well; 30 and `( ) +` pass other posts."""
    files = write(job(name=name), setup=True, **krl)
    for file, content in files.items():
        stem = file.partition(".")[0]
        assert re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,23}", stem)
        text = content.decode()
        assert re.search(rf"^(DEF {stem}\( \)|DEFDAT {stem})$", text.replace("\r", ""), re.M)
        for word in re.findall(r"DECL \w+ (\w+)", text):
            assert len(word) <= 24
    assert len({file.upper() for file in files}) == len(files)


def test_points_are_named_as_in_the_cam_file():
    path = plans.toolpath(11, names=tuple(f"hole number {i:015d}" for i in range(11)))
    data = write(job(path=path), points="dat")["TEST.dat"].decode()
    names = re.findall(r"DECL E6(?:POS|AXIS) (\w+)=", data)
    assert len(set(names)) == len(names) == 12  # the arc has two
    assert all(len(name) <= 24 for name in names)
    assert names[0].startswith("Xhole_number_")


@pytest.mark.parametrize("krl", STYLES)
def test_header_and_declarations(krl):
    """`& REL 1` is no header; a declaration with a value in the .src is an error."""
    for name, content in write(job(), **krl).items():
        lines = content.decode().split("\r\n")
        head = [line for line in lines if line.startswith("&")]
        assert head
        assert head == lines[: len(head)]
        assert all(texts.HEADER.match(line) for line in head)
        assert not any("DISKPATH" in line for line in head)
        if name.endswith(".src"):
            assert not any(re.match(r"\s*DECL\b", line) for line in lines)
        else:
            assert all("\n" not in line for line in lines)


@pytest.mark.parametrize("krl", STYLES)
def test_every_line_is_an_instruction_that_controllers_know(krl):
    files = write(job(), setup=True, **krl)
    for name in texts.sources(files):
        for line in texts.code(files, name):
            assert texts.INSTRUCTION.match(line), line
            assert len(line) < 250


@pytest.mark.parametrize("krl", STYLES)
def test_every_point_used_is_declared_and_every_declared_one_used(krl):
    files = write(job(), **krl)
    for name in texts.sources(files):
        data = files[name.replace(".src", ".dat")].decode()
        declared = re.findall(r"DECL (?:E6POS|E6AXIS|FDAT|PDAT|LDAT) (\w+)=", data)
        used = set(re.findall(r"\b(?:XP|FP|PPDAT|LCPDAT)\d+\b", "\n".join(texts.code(files, name))))
        assert sorted(used) == sorted(set(declared))
        assert len(set(declared)) == len(declared)


@pytest.mark.parametrize("krl", STYLES)
def test_folds_and_blocks_are_balanced(krl):
    files = write(job(path=plans.toolpath(11, operations=("a", "b"))), **krl)
    for content in files.values():
        depth = 0
        for line in content.decode().split("\r\n"):
            depth += line.startswith(";FOLD") - line.startswith(";ENDFOLD")
            assert depth >= 0
        assert depth == 0
        text = content.decode()
        assert len(re.findall(r"^SPLINE", text, re.M)) == text.count("ENDSPLINE")


@pytest.mark.parametrize("krl", STYLES)
def test_classic_and_spline_motions_do_not_mix(krl):
    files = write(job(), **krl)
    words = {
        line.split()[0] for name in texts.sources(files) for line in texts.motions(files, name)
    }
    assert words <= {"PTP", "LIN", "CIRC"} or words <= {"SPTP", "SLIN", "SCIRC"}


def test_nothing_of_the_machine_or_the_day_is_in_a_program():
    path = plans.toolpath(11, path="/home/somebody/jobs/wing.cls")
    text = b"".join(write(job(path=path)).values()).decode()
    assert "wing.cls" in text
    assert "somebody" not in text
    assert not re.search(r"\b20\d\d\b|\d+:\d\d:\d\d", text)
    path = plans.toolpath(11, path="C:\\Users\\somebody\\wing.cls")
    text = b"".join(write(job(path=path)).values()).decode()
    assert "somebody" not in text
