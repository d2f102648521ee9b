"""Rows 18 and 20: where blending is forbidden or lost, and what stops the advance run."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import transform_from_kuka
from postproc.krl import text as krl
from postproc.krl.rules.part import Part, Step, key_of, position_of
from postproc.krl.rules.subject import ERROR, Subject

FEED = 0.1
"""Path speed [m/s] up to which a motion is taken for a cut; rapids are faster."""
_REVERSAL = -0.9995
"""Cosine between coming and going from which on a motion comes back the way it went."""
_ALONG = 0.9998
"""Cosine from which on a way goes along an axis: within about 1 degree."""
_READS = re.compile(r"\$(IN|ANIN|POS_ACT|AXIS_ACT|POS_INT|AXIS_INT)\b", re.IGNORECASE)
_WRITES = ("$OUT[", "$ANOUT[")


def blending(subject: Subject) -> None:
    """Row 18: kinds of blending, last motion, plunges, waits, borders."""
    for part in subject.parts:
        blended = [place for place, words in enumerate(part.blends) if words]
        _kinds(part, [part.steps[place] for place in blended])
        _plunges(part)
        for place in blended:
            if part.steps[place].index not in part.in_block:
                _behind(part, place)
    _last_motions(subject)


def _kinds(part: Part, blended: Sequence[Step]) -> None:
    """Check the words of blended motions; most of them are a word that may stand there."""
    for step in blended:
        words, move = step.move.blend, step.move
        is_usual = words == ("C_DIS",) or (words == ("C_SPL",) and move.word.is_spline)
        if not is_usual or step.index in part.in_block:
            _kind(part, step)


def _kind(part: Part, step: Step) -> None:
    move, line = step.move, step.move.line
    words = set(move.blend)
    if step.index in part.in_block:
        part.error(18, line, f"{move.blend[0]} within a spline block")
    elif "C_PTP" in words and not move.word.is_axis_motion:
        part.error(18, line, f"C_PTP on a {move.word.value}: only a PTP takes it")
    elif "C_SPL" in words and not move.word.is_spline:
        part.error(18, line, f"C_SPL on a {move.word.value}: only SPTP, SLIN, SCIRC take it")
    elif move.word.is_spline and words - {"C_SPL", "C_DIS"}:
        part.warn(18, line, f"{move.blend[0]} on a {move.word.value}: C_SPL is meant")


def _behind(part: Part, place: int) -> None:
    """What stands between a blended motion and the next one."""
    step = part.steps[place]
    last = place + 1 == len(part.steps)
    between = (
        part.routine.statements[step.index + 1 :]
        if last
        else part.between(step, part.steps[place + 1])
    )
    for statement in between:
        if isinstance(statement, krl.WaitSec | krl.WaitFor | krl.Halt):
            message = f"blended, and {_word(statement)} comes after it: the blend is lost"
            part.warn(18, step.move.line, message)
            return
        if isinstance(statement, krl.Call):
            target = part.subject.called(statement.name, part.module)
            if target is not None and key_of(*target) in part.subject.moving:
                message = f"blended at the border to {target[1].name}: the blend may be lost"
                part.warn(18, step.move.line, message)
                return
        if isinstance(statement, krl.Control):
            return
    if not last:
        _next_kind(part, step.move, part.steps[place + 1].move)


def _word(statement: krl.Statement) -> str:
    return "HALT" if isinstance(statement, krl.Halt) else "a WAIT"


def _next_kind(part: Part, move: krl.Move, following: krl.Move) -> None:
    if move.word.is_spline != following.word.is_spline:
        part.warn(18, move.line, f"{move.word.value} does not blend into {following.word.value}")


def _plunges(part: Part) -> None:
    """A motion that comes back the way it went must stop where it turns; a plunge also before."""
    if len(part.steps) < 3:
        return
    way = np.diff(part.positions, axis=0)
    begin, end = _headings(part, way)
    turns = np.flatnonzero(np.einsum("ij,ij->i", end[:-1], begin[1:]) < _REVERSAL) + 1
    turns = turns[part.is_path[turns] & part.is_path[turns + 1]]
    for place in turns.tolist():
        bottom, before = part.steps[place], part.steps[place - 1]
        if not (bottom.move.blend or before.move.blend):
            continue
        if bottom.index in part.in_block or not _is_plunge(part, place):
            continue
        if bottom.move.blend:
            message = "blended where the tool turns back at feed: the depth is not reached"
            part.error(18, bottom.move.line, message)
        if before.move.blend and _is_along_tool(bottom, way[place - 1]) and _sets_feed(part, place):
            message = "blended before a plunge: the tool goes down beside the hole"
            part.error(18, before.move.line, message)


def _headings(part: Part, way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return directions (k-1, 3) in which the motions behind the first begin and end, or NaN."""
    begin, end = way.copy(), way.copy()
    places = [k for k, step in enumerate(part.steps) if k and step.move.word.is_circular]
    if places:
        rows = np.array(places) - 1
        aux = np.array([_auxiliary(part, place) for place in places], dtype=np.float64)
        to_aux, from_aux = aux - part.positions[rows], part.positions[places] - aux
        begin[rows] = _inverted(to_aux) - _inverted(way[rows])
        end[rows] = _inverted(from_aux) - _inverted(way[rows])
    with np.errstate(invalid="ignore", divide="ignore"):
        begin, end = (ways / np.linalg.norm(ways, axis=1)[:, None] for ways in (begin, end))
    return begin, end


def _auxiliary(part: Part, place: int) -> tuple[float | None, ...]:
    """Return X, Y, Z [mm] of the auxiliary point of a circle that ends at its target."""
    move = part.steps[place].move
    known = move.auxiliary is not None and move.angle_deg is None
    return position_of(part.subject.point(move.auxiliary, part.module) if known else None)


def _inverted(ways: FloatArray) -> FloatArray:
    """Return ways (k, 3) inverted in the unit circle around where they begin."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(ways / np.einsum("ij,ij->i", ways, ways)[:, None])


def _is_along_tool(bottom: Step, way: FloatArray) -> bool:
    """Whether a way (3,) goes along an axis of the TCP frame, as a tool plunges."""
    pose = bottom.target
    if not isinstance(pose, krl.Pose) or pose.a_deg is None or pose.b_deg is None:
        return True
    abc = np.array([pose.a_deg, pose.b_deg, pose.c_deg or 0.0])
    R_base_tcp = transform_from_kuka(np.zeros(3), abc)[:3, :3]
    along = np.abs(R_base_tcp.T @ way) / np.linalg.norm(way)
    return bool(along.max() > _ALONG)


def _is_plunge(part: Part, place: int) -> bool:
    """Whether the way to a turning point is made at feed, or the program waits there."""
    behind = part.between(part.steps[place], part.steps[place + 1])
    return not part.path_speeds[place] > FEED or any(isinstance(s, krl.WaitSec) for s in behind)


def _sets_feed(part: Part, place: int) -> bool:
    before = part.between(part.steps[place - 1], part.steps[place])
    return any(isinstance(s, krl.Assign) and s.target == "$VEL.CP" for s in before)


def _last_motions(subject: Subject) -> None:
    for module, routine in subject.entries():
        last: tuple[str, krl.Move] | None = None
        for here, statement in subject.walk(module, routine, krl.Move):
            if isinstance(statement, krl.Move):
                last = here.src_path, statement
        if last is not None and last[1].blend:
            message = "the last motion of the program is blended"
            subject.add(18, ERROR, last[0], last[1].line, message)


# ---------------------------------------------------------------------------------- advance run


def advance_stops(subject: Subject) -> None:
    """Row 20: inputs, outputs and positions stop the advance run: the tool marks the part.

    Checked between two path motions where the first is blended or made at feed.
    """
    for part in subject.parts:
        if not any(map(_access, part.different)):
            continue
        at_feed = (part.path_speeds <= FEED).tolist()
        for place in (np.flatnonzero(part.is_path[1:] & part.is_path[:-1]) + 1).tolist():
            before = part.steps[place - 1]
            between = part.between(before, part.steps[place])
            if between and (before.move.blend or at_feed[place - 1]):
                _stops(part, between)


def _stops(part: Part, between: Sequence[krl.Statement]) -> None:
    saved = False
    for statement in between:
        what = _access(statement)
        if what and not saved:
            message = f"{what} between two path motions stops the advance run"
            part.warn(20, statement.line, message, "CONTINUE before it, or a TRIGGER")
        saved = isinstance(statement, krl.Continue)


def _access(statement: krl.Statement) -> str:
    if isinstance(statement, krl.Assign):
        if statement.target[:1] == "$":
            target = statement.target.upper()
            if target.startswith(_WRITES):
                return target
        text = getattr(statement.value, "text", "")
    elif isinstance(statement, krl.Call):
        if statement.name.upper() == "PULSE":
            return "PULSE"
        text = ",".join(getattr(argument, "text", "") for argument in statement.arguments)
    elif isinstance(statement, krl.WaitFor):
        text = statement.condition
    else:
        text = statement.text if isinstance(statement, krl.Control) else ""
    found = _READS.search(text) if text else None
    return found.group().upper() if found else ""
