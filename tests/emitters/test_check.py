"""The check before a program lands: the text says the moves of the plan and no others."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.emitters import (
    EMITTERS,
    Emitter,
    Program,
    ReadBack,
    differences,
    emit,
    emitter_of,
    motions_of,
    written,
)
from postproc.errors import EmitError, Finding, PluginError, Severity
from postproc.jobs.convert import ConvertRequest, convert
from postproc.model import MoveKind
from postproc.registry import PluginInfo
from postproc.testing import made_cell, made_plan
from tests.cells import FEED, STIFFNESS, cell_text

PTP, LIN, CIRC = MoveKind.PTP, MoveKind.LIN, MoveKind.CIRC


@pytest.fixture
def plan():
    return made_plan()


@pytest.fixture
def read(plan):
    """What a true read-back of the plan says."""
    return ReadBack(plan.kind, plan.q, aux=plan.aux, speed=plan.speed)


def words(plan, read):
    return " | ".join(finding.message for finding in differences(plan, made_cell(), read))


def with_row(values, row, value):
    changed = np.array(values)
    changed[row] = value
    return changed


def test_the_plan_is_the_plan(plan, read):
    assert words(plan, read) == ""


def test_rounding_is_let_pass(plan, read):
    rng = np.random.default_rng(3)
    near = plan.q + rng.uniform(-5e-7, 5e-7, plan.q.shape)
    assert words(plan, replace(read, q=near)) == ""


@pytest.mark.parametrize("row", [0, 4, 12])
def test_a_tool_that_is_elsewhere_is_found(plan, read, row):
    """0.01 deg of A1 are 0.3 mm at the end of the arm."""
    moved = with_row(plan.q, row, plan.q[row] + np.radians([0.01, 0, 0, 0, 0, 0]))
    assert "the tool is not where the plan has it" in words(plan, replace(read, q=moved))


def test_another_posture_with_the_same_tool_is_found(plan, read):
    """A whole turn of A6 leaves the tool where it is and winds up the cables."""
    turned = with_row(plan.q, 7, plan.q[7] + np.radians([0, 0, 0, 0, 0, 360.0]))
    assert words(plan, replace(read, q=turned)).endswith("another posture of the arm")


def test_a_place_out_of_reach_is_found(plan, read):
    assert "not where the plan has it" in words(plan, replace(read, q=with_row(plan.q, 5, np.nan)))


def test_a_line_in_place_of_an_arc_is_found(plan, read):
    arc = int(np.flatnonzero(plan.kind == CIRC)[0])
    assert "another kind" in words(plan, replace(read, kind=with_row(plan.kind, arc, LIN)))


def test_an_arc_over_another_point_is_found(plan, read):
    arc = int(np.flatnonzero(plan.kind == CIRC)[0])
    other = with_row(plan.aux, arc, plan.aux[arc] + [0.0, 0.0, 1e-4])
    assert "an arc goes another way" in words(plan, replace(read, aux=other))
    assert "an arc goes another way" in words(plan, replace(read, aux=None))


@pytest.mark.parametrize(("rise_mm", "is_line"), [(0.009, True), (0.02, False)])
def test_a_flat_arc_may_be_a_line(plan, read, rise_mm, is_line):
    arc = int(np.flatnonzero(plan.kind == CIRC)[0])
    start, end = plan.T_base_tcp[arc - 1, :3, 3], plan.T_base_tcp[arc, :3, 3]
    flat = with_row(plan.aux, arc, 0.5 * (start + end) + [0.0, 0.0, 1e-3 * rise_mm])
    text = replace(read, kind=with_row(plan.kind, arc, LIN), aux=with_row(plan.aux, arc, np.nan))
    assert (words(replace(plan, aux=flat), text) == "") is is_line


def test_another_speed_is_found_where_the_text_says_one(plan, read):
    assert "another path speed" in words(plan, replace(read, speed=plan.speed * 60.0))
    assert words(plan, replace(read, speed=np.full(len(plan), np.nan))) == ""


def test_external_axes_have_to_be_told(plan, read):
    rail = replace(plan, external=np.ones((len(plan), 1)))
    assert "an external axis is elsewhere" in words(rail, read)


@pytest.mark.parametrize("rows", [[*range(12)], [0, *range(2, 13)], [*range(6), *range(7, 13)]])
def test_a_move_that_is_missing_is_found(plan, read, rows):
    part = ReadBack(read.kind[rows], read.q[rows], aux=read.aux[rows])
    assert "not have all 13 moves" in words(plan, part)


def inserted(read, place, kind, q):
    return ReadBack(
        np.insert(read.kind, place, kind),
        np.insert(read.q, place, q, axis=0),
        aux=np.insert(read.aux, place, np.nan, axis=0),
    )


def test_a_motion_too_many_is_found(plan, read):
    """Nobody has proven it free of collision."""
    home = plan.q[0] + 0.5
    assert "not in the plan" in words(plan, inserted(read, 5, PTP, home))
    assert words(plan, inserted(read, 5, LIN, plan.q[5])) != ""


@pytest.mark.parametrize("place", [5, 7, 13])
def test_a_joint_motion_of_no_length_is_let_pass(plan, read, place):
    """Before a line, before a joint motion, and behind all."""
    longer = inserted(read, place, PTP, plan.q[place - 1])
    assert words(plan, longer) == ""
    motion = motions_of(plan, longer.kind != PTP, longer.q)
    assert motion.tolist() == [*range(place), *range(place + 1, 14)]


def test_ways_from_and_to_a_home_of_a_template_are_let_pass(plan, read):
    home = plan.q[0] + 0.5
    led = inserted(inserted(read, len(plan), PTP, home), 0, PTP, home)
    assert words(plan, led) == ""
    motion = motions_of(plan, led.kind != PTP, led.q)
    assert motion.tolist() == list(range(1, 14))


def test_the_place_of_a_fault_is_told(plan, read):
    moved = with_row(plan.q, 4, plan.q[4] + 0.01)
    lines = replace(read, q=moved, files=("a.txt",), file=np.zeros(13), line=np.arange(13) + 7)
    (finding,) = differences(plan, made_cell(), lines)
    assert (finding.code, str(finding.source)) == ("EMT342", "a.txt:11")


def test_an_unknown_emitter_is_one_error_with_those_known():
    cell = made_cell().with_keys({"emitter": "fanuc"})
    with pytest.raises(EmitError, match=r"EMT340: no emitter is named 'fanuc', expected kuka_krl"):
        emitter_of(cell)
    assert cell.with_keys({}) is cell


class Blind(Emitter):
    """Offers no read-back."""

    def emit(self, plan, cell):
        return Program(plan.name, {"a.txt": b"text"})


class Silent(Blind):
    """Offers one that says nothing."""

    def read_back(self, program, cell, against):
        return None


class Wrong(Blind):
    """Says other motions than those of the plan."""

    def read_back(self, program, cell, against):
        return ReadBack(np.array([PTP]), np.zeros((1, 6)))


class Doubtful(Blind):
    """Says the motions of the plan, and that something else is wrong."""

    def emit(self, plan, cell):
        self.plan = plan
        return super().emit(plan, cell)

    def read_back(self, program, cell, against):
        finding = Finding(Severity.ERROR, "EXM009", "the text has no end")
        return ReadBack(self.plan.kind, self.plan.q, aux=self.plan.aux, findings=(finding,))


class Failing(Wrong):
    def emit(self, plan, cell):
        raise KeyError("x")


@pytest.fixture
def request_of(tmp_path, monkeypatch):
    """Return a function: an emitter to the request of a conversion that it shall write."""
    (tmp_path / "cell.toml").write_text(cell_text(FEED, STIFFNESS))
    (tmp_path / "p.csv").write_text("x,y,z,i,j,k\n0,0,0,0,0,1\n50,0,0,0,0,1\n")
    list(EMITTERS)
    info = PluginInfo("emitters", "mine", "my-package", "1.0")
    monkeypatch.setattr(EMITTERS, "_infos", [*EMITTERS._infos, info])

    def request(emitter):
        monkeypatch.setitem(EMITTERS._parts, "mine", emitter)
        return ConvertRequest(
            str(tmp_path / "p.csv"), str(tmp_path / "cell.toml"), keys={"emitter": "mine"}
        )

    return request


@pytest.mark.parametrize("kind", [Blind, Silent])
def test_convert_refuses_an_emitter_that_cannot_be_checked(kind, request_of):
    with pytest.raises(EmitError, match="EMT341: the emitter 'mine' cannot read its programs back"):
        convert(request_of(kind()))


@pytest.mark.parametrize(("kind", "code"), [(Wrong, "EMT342"), (Doubtful, "EXM009")])
def test_convert_lands_nothing_that_fails_its_check(kind, code, request_of):
    done = convert(request_of(kind()))
    assert not done.good
    assert done.files == {}
    assert [finding.code for finding in done.findings if finding.is_error] == [code]


def test_a_foreign_emitter_that_fails_is_named(request_of):
    with pytest.raises(
        PluginError, match=r"PLG006: emitter 'mine' of my-package 1\.0 failed: KeyE"
    ):
        convert(request_of(Failing()))


def test_a_measuring_program_is_checked_as_well(plan, monkeypatch):
    list(EMITTERS)
    monkeypatch.setitem(EMITTERS._parts, "mine", Wrong())
    cell = made_cell().with_keys({"emitter": "mine"})
    assert emit(plan, cell).files
    with pytest.raises(EmitError, match="EMT343: the program fails its check"):
        written(plan, cell)
