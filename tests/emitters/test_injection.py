"""Hostile text in every place of the input: the program stays the same but for its comments."""

import re
from dataclasses import replace

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from postproc.emitters.kuka.emitter import emit, render_files
from postproc.model.plan import MoveKind
from postproc.model.toolpath import EventKind

from . import plans, texts

HOSTILE = [
    "x\nHALT",
    "x\r\nEND\r\nDEF EVIL( )\r\n$OUT[1]=TRUE",
    "; $OUT[1]=TRUE",
    '"); HALT',
    'PP_STOP() "',
    ";FOLD INI;%{PE}",
    "ENDFOLD (INI)",
    ";ENDFOLD",
    "&ACCESS RW",
    "DEF A( )",
    "A" * 500,
    "Fräskopf ø12 日本 \U0001f600",
    "a\x00\x1b[2Jb\x7f\x85c\u2028HALT",
    "{{ 7*7 }}{% for i in range(9) %}HALT{% endfor %}",
    "{{ hooks.__class__ }}",
    "@event@ @input@ @@ @",
    "%{PE}%R 8.3.42,%MKUKATPBASIS,%CMOVE,%VLIN,%P 1:LIN",
    "Params IlfProvider=x; Kuka.PointName=P1",
    "../../evil",
    "CON",
    "",
    "   ",
]


def files_with(text, **krl):
    """Write a program with ``text`` as program, file, operation, tool and point name and events."""
    path = plans.toolpath(
        7,
        path=f"/data/{text}.cls",
        operations=(text, text),
        operation=[0, 0, 0, 1, 1, 1, 1],
        names=tuple(text for _ in range(7)),
    )
    kinds = (EventKind.MESSAGE, EventKind.UNKNOWN, EventKind.SPINDLE_ON, EventKind.COOLANT_ON)
    events = [plans.event(i, kind, 10.0, text) for kind in kinds for i in (0, 3)]
    plan = plans.milling(name=text, path=path, events=events, compensation_note=text)
    return render_files(emit(plan, plans.cell(tool_name=text, setup=True, **krl)))


def without_names(files):
    """The instructions of all files, names of modules and points made equal."""
    found = []
    for name in texts.sources(files):
        stem = name.partition(".")[0]
        main = texts.sources(files)[0].partition(".")[0]
        for line in texts.code(files, name):
            plain = re.sub(rf"^(DEF )?({stem}|{main}_\d+)\(", r"\1NAME(", line)
            found.append(re.sub(r"^(S?PTP|S?LIN) (X\w+)", r"\1 POINT", plain))
    return found


@pytest.mark.parametrize("krl", [{}, {"points": "dat"}, {"max_points_per_file": 3}])
@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_changes_no_instruction(text, krl):
    files = files_with(text, **krl)
    assert without_names(files) == without_names(files_with("harmless", **krl))
    for name, content in files.items():
        assert re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,23}\.(src|dat)", name)
        assert content.replace(b"\r\n", b"").decode("ascii").isprintable()
        for line in content.split(b"\r\n"):
            assert len(line) < 250


@pytest.mark.parametrize("text", HOSTILE)
def test_folds_stay_balanced_and_headers_few(text):
    files = files_with(text)
    calm = files_with("harmless")
    for (_, content), (_, other) in zip(files.items(), calm.items(), strict=True):
        for mark in (b"\r\n;FOLD", b"\r\n;ENDFOLD", b"\r\n&", b"%{"):
            assert content.count(mark) == other.count(mark)


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=200))
def test_any_text_changes_no_instruction(text):
    assume(not re.search("THRU|THROUGH|TAPKUL|HIGH|MIST|AIR|FLOOD", text.upper()))  # words
    assert without_names(files_with(text)) == without_names(files_with("harmless"))


def test_a_message_is_shown_as_far_as_a_comment_can():
    files = files_with("Check clamp; then GO!")
    lines = texts.lines(files, texts.sources(files)[0])
    assert "; CAM line 7: message: Check clamp, then GO!" in lines
    assert "PP_SPINDLE_ON(600) ; CAM line 7: Check clamp, then GO!" in lines


def test_numbers_of_events_are_printed_as_numbers():
    moves = [{"kind": MoveKind.PTP}, {}]
    event = plans.event(0, EventKind.SPINDLE_ON, 33.333333333, "x")
    path = replace(plans.toolpath(2))
    files = render_files(emit(plans.plan(moves, events=[event], path=path), plans.cell()))
    assert any(line == "PP_SPINDLE_ON(2000)" for line in texts.code(files, "TEST.src"))
    event = plans.event(0, EventKind.SPINDLE_ON, 0.0123456, "x")
    files = render_files(emit(plans.plan(moves, events=[event]), plans.cell()))
    assert any(line.startswith("PP_SPINDLE_ON(0.74") for line in texts.code(files, "TEST.src"))
