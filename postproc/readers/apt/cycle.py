"""Drill cycles: begun, changed, suspended and ended; their parameters to a ``Cycle`` of the model.

Where a file leaves a height open: the feed starts 2 mm above the point (with a warning); the tool
ends at the height where the feed starts.
"""

from __future__ import annotations

from math import isnan, nan, radians

from postproc.model import ORIENT, Cycle, CycleKind, WordClass
from postproc.readers.apt.cycletext import Found, is_catia_order, is_hsm_order, parameters
from postproc.readers.apt.dialect import CycleGrammar, CycleRule
from postproc.readers.apt.heights import LEFT, READINGS, ByTurns, Heights, with_levels
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded
from postproc.readers.base import DEFAULT_CLEARANCE

NAN = nan

_KINDS = {
    "DRILL": CycleKind.DRILL, "SPOT": CycleKind.DRILL, "FACE": CycleKind.FACE,
    "CSINK": CycleKind.CSINK, "DEEP": CycleKind.DEEP, "DEEP2": CycleKind.DEEP,
    "THRU": CycleKind.DRILL, "BRKCHP": CycleKind.BRKCHP, "BREAKCHIP": CycleKind.BRKCHP,
    "TAP": CycleKind.TAP, "REVERS": CycleKind.TAP_LEFT, "RIGID": CycleKind.RIGID_TAP,
    "BORE": CycleKind.BORE, "BORE5": CycleKind.BORE, "BORE6": CycleKind.BORE,
    "BORE7": CycleKind.BORE, "BORE8": CycleKind.BORE_RAPID, "BORE9": CycleKind.BORE,
    "SHIFT": CycleKind.BORE, "REAM": CycleKind.REAM,
}  # fmt: skip
"""Cycle words and the kind of the model."""
_REFUSED = {
    "BORE7": "the tool is to be taken out by hand",
    "BORE9": "back boring: the tool works on its way out",
    "SHIFT": "the spindle is to stand at an angle and the tool to move off the wall",
}
_PECKING = frozenset(
    {CycleKind.DRILL, CycleKind.DEEP, CycleKind.BRKCHP, CycleKind.FACE, CycleKind.CSINK}
)
_REPLACES = {
    "feed": {"feed_per_turn", "pitch"},
    "feed_per_turn": {"feed", "pitch"},
    "pitch": {"feed", "feed_per_turn"},
    "dwell": {"dwell_turns"},
    "dwell_turns": {"dwell"},
}
"""What a parameter changed by CYCLE/ON puts out of force."""
_SIEMENS = {"CYCLE81": 5, "CYCLE82": 6, "CYCLE83": 12}
"""Siemens drill cycles and how many numbers each has at most: RTP, RFP, SDIS, DP, DPR, ..."""


def cycle_statement(state: AptState, statement: Statement) -> None:
    """Handle CYCLE/...: begin, change, resume or end a drill cycle."""
    words = statement.upper
    first = words[0] if words else ""
    if first in _SIEMENS:
        siemens_statement(state, Statement(first, statement.args[1:], statement.text))
    elif first in {"OFF", "NOMORE"}:
        state.cycle.set(state.at, -1)
    elif first in {"INIT", "CLEAR"}:
        state.cycle.set(state.at, -1)
        state.drill.words, state.drill.last = {}, -1
    elif first == "ON":
        _resume(state, statement)
    elif first == "MILL" or first not in _KINDS:
        _no_hole(state, statement, first)
    else:
        _drill(state, statement)


def _resume(state: AptState, statement: Statement) -> None:
    """CYCLE/ON brings the last cycle back; with parameters, these change it."""
    if len(statement.args) == 1:
        if state.drill.last < 0:
            state.drill.void.append((state.tag, state.line))
        state.cycle.set(state.at, state.drill.last)
        return
    if not state.drill.words:
        raise state.error("APT040", "CYCLE/ON with parameters but no cycle before it")
    kind = state.cycles[state.drill.last].kind
    new = parameters(state, statement)
    gone = set().union(*(_REPLACES.get(name, set()) for name in new)) - set(new)
    found = {**{k: v for k, v in state.drill.words.items() if k not in gone}, **new}
    _begin(state, kind, found, statement)


def _no_hole(state: AptState, statement: Statement, first: str) -> None:
    """Take the points of a cycle that makes no hole, or an unknown one, as plain moves."""
    state.cycle.set(state.at, -1)
    name = f"CYCLE/{first[:20]}"
    if first == "MILL" and len(statement.args) == 1:
        state.note(name, WordClass.PROCESS, "only positions; its point is no hole")
        return
    why = {
        "MILL": "only positions; its depth is not run",
        "CIRCUL": "mills a circular pocket, which is not run",
    }.get(first, "is not a drill cycle that is known; its points are read as plain moves")
    state.refuse(name, WordClass.GEOMETRY, f"{first[:20]} {why}")


def _drill(state: AptState, statement: Statement) -> None:
    """Begin a cycle; equal texts are parsed once."""
    known = state.drill.memo.get(statement.text)
    if known is not None:
        index, state.drill.words, said = known
        state.uses.repeat(said, state.line)
        state.drill.heights[index][2].append(state.line)
        state.drill.last = index
        state.cycle.set(state.at, index)
        return
    before = len(state.uses.log)
    words = statement.upper
    found = parameters(state, statement)
    _ask_order(state, statement)
    _begin(state, _kind(state, words, found), found, statement)
    said = state.uses.log[before:]
    state.drill.memo[statement.text] = int(state.cycle.value), found, said


def _ask_order(state: AptState, statement: Statement) -> None:
    """Ask back what the numbers of a cycle mean where the seat is not known."""
    words = statement.upper
    if (
        state.options.cycle_words is not None
        or state.dialect.cycle_grammar is not CycleGrammar.UNKNOWN
        or len(words) < 2
        or bounded(words[1]) is None
    ):
        return
    if is_hsm_order(words):
        what = (
            "Fusion (GOTO at the bottom of the hole, clearance an absolute height) or HSMWorks of "
            "2011 (GOTO at its top, clearance from the bottom); read with GOTO and clearance at "
            "and above the top"
        )
        hint = f"--dialect fusion or --dialect hsmworks, or {READINGS}"
    else:
        seat = "CATIA" if is_catia_order(words) else "SURFCAM"
        what = (
            "depth, feed, clearance (SURFCAM), depth, clearance, feed (CATIA) or the order of "
            f"another table; read as those of {seat}"
        )
        hint = f"--dialect surfcam or --dialect catia, or {READINGS}"
    reason = f"the numbers have no words and the seat is not known: {what}"
    state.refuse(f"CYCLE/{words[0]}", WordClass.GEOMETRY, reason, hint)


def siemens_statement(state: AptState, statement: Statement) -> None:
    """Handle CYCLE81/..., CYCLE82/... and CYCLE83/... with Siemens' positional numbers.

    Also written ``CYCLE/CYCLE81,...`` and ``MCALL CYCLE81(...)``; modal until CYCLE/OFF or MCALL.
    RTP retract plane, RFP reference plane, SDIS safety distance, DP absolute final depth, DPR depth
    below RFP; heights count from RFP, which is taken to be the height of the GOTO point.
    """
    numbers = [bounded(arg) if arg else NAN for arg in statement.args]
    most = _SIEMENS[statement.word]
    if not 4 <= len(numbers) <= most or None in numbers:
        raise state.error("APT041", f"{statement.word} needs RTP, RFP, SDIS, DP[, DPR, ...]")
    values = [NAN if v is None else v for v in numbers] + [NAN] * (most - len(numbers))
    retract, reference, safety, absolute, relative = values[:5]
    reference = 0.0 if isnan(reference) else reference
    depth = relative if not isnan(relative) else reference - absolute
    found = {"depth": abs(depth) if not isnan(relative) else depth, "clearance": abs(safety),
             "retract": retract - reference}  # fmt: skip
    kind = CycleKind.DRILL
    if statement.word == "CYCLE82":
        found["dwell"] = values[5]
    if statement.word == "CYCLE83":
        kind = CycleKind.DEEP
        first_depth, first_relative, degression = values[5], values[6], values[7]
        first = first_relative if not isnan(first_relative) else reference - first_depth
        found |= {"peck_first": abs(first), "peck": abs(first) - max(degression, 0.0)
                  if not isnan(degression) and degression < abs(first) else abs(first),
                  "dwell": values[8]}  # fmt: skip
    found = {name: value for name, value in found.items() if not isnan(value)}
    found.setdefault("depth", NAN)
    _begin(state, kind, found, statement, signed=False)


def _kind(state: AptState, words: tuple[str, ...], found: Found) -> CycleKind:
    """Return what a cycle does, by the seat's meaning of the words."""
    first = words[0]
    kind = _KINDS[first]
    if first in _REFUSED:
        state.refuse(f"CYCLE/{first}", WordClass.PROCESS, _REFUSED[first])
    if "DEEP" in words[1:]:
        kind = CycleKind.DEEP
    if "BRKCHP" in words[1:]:
        kind = CycleKind.BRKCHP
    if "REVERS" in words[1:]:
        kind = CycleKind.TAP_LEFT
    if kind is CycleKind.DEEP and state.dialect.cycle_rule.deep_breaks:
        kind = CycleKind.BRKCHP
    elif kind is CycleKind.DEEP and state.dialect.cycle_grammar is CycleGrammar.UNKNOWN:
        reason = "full retracts after each peck; some systems mean chip breaking"
        state.note("CYCLE/DEEP", WordClass.PROCESS, reason)
    _refuse_undone(state, first, kind, found)
    return kind


def _refuse_undone(state: AptState, first: str, kind: CycleKind, found: Found) -> None:
    """Refuse what a cycle asks for and no stroke of its kind does."""
    if kind not in _PECKING and {"peck", "peck_first"} & set(found):
        reason = f"a {kind.replace('_', ' ')} cycle with pecks: the tool would leave in rapid"
        state.refuse(f"CYCLE/{first}", WordClass.PROCESS, reason)
    if kind in (CycleKind.DEEP, CycleKind.BRKCHP) and not (
        found.get("peck") or found.get("peck_first")
    ):
        text = f"{first} asks for pecks, and nothing says how deep: the hole is drilled at once"
        state.refuse("CYCLE/STEP", WordClass.PROCESS, text)
    if "orient" in found:
        reason = "the spindle is to stand at an angle before the tool leaves the hole"
        state.refuse(ORIENT, WordClass.PROCESS, reason, "for a bore: [krl.hooks] spindle_orient")
    if found.get("shift"):
        reason = "the tool is to move off the wall before it leaves the hole"
        state.refuse("CYCLE/SHIFT", WordClass.PROCESS, reason)


def _begin(
    state: AptState, kind: CycleKind, found: Found, statement: Statement, signed: bool = True
) -> None:
    """Let a cycle hold from the next point on; equal cycles share one entry of the table."""
    state.drill.words = found
    depth = _depth(state, found, signed)
    cycle = _cycle(state, kind, depth, found)
    if cycle.repeat > 1:
        text = f"each hole is to be made {cycle.repeat} times"
        state.refuse("CYCLE/REPEAT", WordClass.PROCESS, text)
    heights = _heights(state, depth, found, signed)
    if not heights.needs_level:
        cycle = _levelled(state, cycle, heights)
    turned = ByTurns(cycle.feed_per_turn, cycle.pitch, found.get("dwell_turns", NAN), kind in LEFT)
    known = state.drill.index.setdefault(f"{cycle!r}{heights!r}{turned!r}", len(state.cycles))
    if known == len(state.cycles):
        state.cycles.append(cycle)
        if turned:
            state.drill.turned[known] = turned
        state.drill.heights[known] = heights, _word(statement), []
    state.drill.heights[known][2].append(state.line)
    state.cycle.set(state.at, known)
    state.drill.last = known
    if cycle.depth == 0.0:
        state.warn("APT142", "a drill cycle with depth 0: the tool only touches")


def _word(statement: Statement) -> str:
    """Return a cycle's word as a user would name it."""
    return f"CYCLE/{statement.upper[0]}" if statement.word == "CYCLE" else statement.word


def _depth(state: AptState, found: Found, signed: bool) -> float:
    """Return the depth in units of the file, positive into the part."""
    depth = found.get("depth", NAN)
    if isnan(depth):
        raise state.error("APT046", "a drill cycle without a depth")
    if signed and state.dialect.signed_depth:
        depth = -depth
    if depth < 0.0:
        raise state.error("APT047", f"a drill cycle whose depth lies {-depth:g} above the hole")
    return depth + 0.0


def _cycle(state: AptState, kind: CycleKind, depth: float, found: Found) -> Cycle:
    """Return the cycle [m, m/s, s] without its levels, from parameters in file units."""
    scale = state.scale
    peck = abs(found.get("peck", 0.0))
    if peck > 0.0 and kind is CycleKind.DRILL:
        kind = CycleKind.DEEP
    return Cycle(
        kind=kind,
        depth=depth * scale,
        clearance=0.0,
        retract=0.0,
        peck_first=abs(found.get("peck_first", peck)) * scale,
        peck=peck * scale,
        break_chip=kind is CycleKind.BRKCHP,
        dwell=max(found.get("dwell", 0.0), 0.0),
        feed=found.get("feed", NAN),
        diameter=found.get("diameter", NAN) * scale,
        pitch=found.get("pitch", NAN) * scale,
        orient=radians(found.get("orient", NAN)),
        shift=found.get("shift", 0.0) * scale,
        repeat=max(int(found.get("repeat", 1.0)), 1),
        feed_per_turn=found.get("feed_per_turn", NAN),
    )


def _heights(state: AptState, depth: float, found: Found, signed: bool) -> Heights:
    """Return what is said about the levels [m]; named positions count from the top of the hole."""
    scale = state.scale
    own = state.options.cycle_words is not None or not signed
    rule = state.dialect.cycle_rule if "clearance" not in found or not own else CycleRule()
    names = ("clearance", "clear", "rapto", "retract", "return")
    clearance, clear, rapto, retract, back = (found.get(name, NAN) * scale for name in names)
    return Heights(rule, depth * scale, clearance, clear, rapto, retract, back)


def _levelled(state: AptState, cycle: Cycle, heights: Heights) -> Cycle:
    """Return the cycle with levels that do not depend on where its holes lie."""
    feed, ends = heights.above(0.0)
    if isnan(feed):
        state.warn("APT141", "a drill cycle without RAPTO or CLEAR: its feed starts 2 mm above")
        feed = DEFAULT_CLEARANCE
        ends = feed if isnan(ends) else ends
    proven = state.dialect.cycle_rule.proven or not heights.rule.safe
    if (feed < 0.0 or ends < 0.0) and proven:
        raise state.error("APT048", "a drill cycle whose heights lie below the hole")
    return with_levels(cycle, feed, ends)


def call_statement(state: AptState, statement: Statement) -> None:
    """Handle MCALL: alone it ends a Siemens cycle that was called with MCALL."""
    state.cycle.set(state.at, -1)
