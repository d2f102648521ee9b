"""Drill cycles: each grammar to the same parameters, and those to a ``Cycle`` of the model.

Heights count from the GOTO point along the tool axis. Where a file leaves a height open: the feed
starts at ``RAPTO``, else at ``CLEAR``, else 2 mm above the point (with a warning); the tool ends at
``RTRCTO``, else (``RTRCTO,AUTO``, nothing) at the height where the feed starts.
"""

from __future__ import annotations

from dataclasses import replace
from math import isnan

from postproc.model import Cycle, CycleKind
from postproc.readers.apt.dialect import CycleGrammar, DepthRule
from postproc.readers.apt.feed import FEED_UNITS, PER_TURN, feed_value
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded
from postproc.units import MM

DEFAULT_CLEARANCE = 2.0 * MM
"""Height [m] above the hole where the feed starts if the file does not say."""
NAN = float("nan")

_KINDS = {
    "DRILL": CycleKind.DRILL, "FACE": CycleKind.FACE, "CSINK": CycleKind.CSINK,
    "DEEP": CycleKind.DEEP, "DEEP2": CycleKind.DEEP, "BRKCHP": CycleKind.BRKCHP,
    "BREAKCHIP": CycleKind.BRKCHP, "THRU": CycleKind.DRILL, "TAP": CycleKind.TAP,
    "BORE": CycleKind.BORE, "BORE5": CycleKind.BORE, "BORE6": CycleKind.BORE,
    "BORE7": CycleKind.BORE, "BORE8": CycleKind.BORE_RAPID, "BORE9": CycleKind.BORE,
    "REAM": CycleKind.REAM, "MILL": CycleKind.DRILL, "SPOT": CycleKind.DRILL,
}  # fmt: skip
"""Cycle words and the kind of the model."""
_ACTIONS = frozenset({"INIT", "ON", "OFF", "CLEAR", "NOMORE"})
_FIELDS = {
    "FEDTO": "depth", "DEPTH": "depth", "RAPTO": "clearance", "CLEAR": "clear",
    "RTRCTO": "retract", "STEP": "peck", "INCR": "peck", "1STPECK": "peck_first",
    "SUBPECK": "peck", "DWELL": "dwell", "CSINK": "ignored", "CSKDIA": "diameter",
    "ORIENT": "ignored", "OFFSET": "ignored", "LEAD": "ignored",
}  # fmt: skip
"""Minor words of the parameters; each is followed by one number."""
_SIEMENS = {"CYCLE81": 5, "CYCLE82": 6, "CYCLE83": 12}
"""Siemens drill cycles and how many numbers each has at most: RTP, RFP, SDIS, DP, DPR, ..."""


def cycle_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle CYCLE/...: begin, change or end a drill cycle."""
    words = statement.upper
    first = words[0] if words else ""
    if first in _SIEMENS:
        siemens_statement(state, Statement(first, statement.args[1:], statement.text), line)
        return
    if first in {"OFF", "NOMORE"}:
        state.cycle.set(state.at, -1)
        return
    if first in {"INIT", "CLEAR"} or (first == "ON" and len(words) == 1):
        state.cycle.set(state.at, -1)
        state.cycle_words = {}
        return
    known = state.cycle_memo.get(statement.text)
    if known is not None:
        index, state.cycle_words = known
        state.cycle.set(state.at, index)
        return
    changed = first == "ON"
    if changed and not state.cycle_words:
        raise state.faults.error(
            "APT040", "CYCLE/ON with parameters but no cycle before it", line, statement.text
        )
    kind = _kind(state, words, line, statement)
    grammar = state.dialect.cycle_grammar
    if grammar is CycleGrammar.CAMWORKS:
        found = _camworks(state, words, line, statement)
    elif _is_positional(words) and grammar is CycleGrammar.WORDS_OR_NUMBERS:
        found = _positional(state, words, line, statement)
    else:
        found = _by_words(state, words, line, statement)
    if changed:
        found = {**state.cycle_words, **found}
        number = int(state.cycle.value)
        kind = state.cycles[number].kind if number >= 0 else CycleKind.DRILL
    state.cycle_words = found
    _begin(state, _cycle(state, kind, found, line, statement), line)
    if not changed and not PER_TURN & set(words):
        state.cycle_memo[statement.text] = int(state.cycle.value), found


def siemens_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle CYCLE81/..., CYCLE82/... and CYCLE83/... with Siemens' positional numbers.

    Also written ``CYCLE/CYCLE81,...`` and ``MCALL CYCLE81(...)``; modal until CYCLE/OFF or MCALL.
    RTP retract plane, RFP reference plane, SDIS safety distance, DP absolute final depth, DPR depth
    below RFP; heights count from RFP, which is taken to be the height of the GOTO point.
    """
    numbers = [bounded(arg) if arg else NAN for arg in statement.args]
    most = _SIEMENS[statement.word]
    if not 4 <= len(numbers) <= most or None in numbers:
        raise state.faults.error(
            "APT041",
            f"{statement.word} needs RTP, RFP, SDIS, DP[, DPR, ...]",
            line,
            statement.text,
        )
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
    _begin(state, _cycle(state, kind, found, line, statement, signed=False), line)


def _kind(state: AptState, words: tuple[str, ...], line: int, statement: Statement) -> CycleKind:
    first = words[0] if words else ""
    if first not in _KINDS and first not in _ACTIONS:
        raise state.faults.error(
            "APT042", f"unknown drill cycle {first[:20]!r}", line, statement.text
        )
    if "DEEP" in words[1:]:
        return CycleKind.DEEP
    if "BRKCHP" in words[1:]:
        return CycleKind.BRKCHP
    return _KINDS.get(first, CycleKind.DRILL)


def _is_positional(words: tuple[str, ...]) -> bool:
    return len(words) > 1 and bounded(words[1]) is not None


def _by_words(
    state: AptState, words: tuple[str, ...], line: int, statement: Statement
) -> dict[str, float]:
    """Return the parameters of minor words, each followed by its number."""
    found: dict[str, float] = {}
    position = 1
    while position < len(words):
        word = words[position]
        follower = words[position + 1] if position + 1 < len(words) else ""
        value = bounded(follower)
        position += 1
        if word in FEED_UNITS and value is not None:
            found["feed"] = feed_value(state, value, word, line)
            position += 1
        elif word in _FIELDS and value is not None:
            found[_FIELDS[word]] = value
            position += 1
        elif word == "RTRCTO" and follower in {"AUTO", "NONE"}:
            position += 1
        elif word in {"DEEP", "BRKCHP"} or (word in {"DWELL", "ORIENT"} and value is None):
            continue
        elif word in _FIELDS:
            raise state.faults.error(
                "APT043", f"{word} of a drill cycle has no number", line, statement.text
            )
        elif value is not None and bounded(word) is None:
            state.faults.warn("APT140", f"drill cycle: {word} is not known and left out", line)
            position += 1
        else:
            raise state.faults.error(
                "APT044",
                f"drill cycle: {word[:20]!r} where a minor word was expected",
                line,
                statement.text,
            )
    return found


def _positional(
    state: AptState, words: tuple[str, ...], line: int, statement: Statement
) -> dict[str, float]:
    """Return the parameters of CATIA's numbers, named by ``ReadOptions.cycle_words``."""
    found: dict[str, float] = {}
    names = list(state.options.cycle_numbers)
    unit = next((word for word in words[1:] if word in FEED_UNITS), "")
    for i, word in enumerate(word for word in words[1:] if word not in FEED_UNITS):
        value = bounded(word)
        if value is None or i >= len(names):
            raise state.faults.error(
                "APT045",
                f"drill cycle: the meaning of {word[:20]!r} is not known",
                line,
                statement.text,
                "name the positions with --cycle-words",
            )
        if names[i] == "feed":
            found["feed"] = feed_value(state, value, unit or "PERMIN", line)
        elif names[i] != "-":
            found[names[i]] = value
    return found


def _camworks(
    state: AptState, words: tuple[str, ...], line: int, statement: Statement
) -> dict[str, float]:
    """Return the parameters of CAMWorks' order; the comma between two heights may be missing.

    G98, depth[, PECKING, first, next], MMPM, feed, rapid height, retract height, initial height,
    DWELL, time.
    """
    tokens = [part for word in words[1:] for part in word.split()]
    found: dict[str, float] = {}
    bare: list[float] = []
    heights: list[float] = []
    position = 0
    while position < len(tokens):
        word = tokens[position]
        value = bounded(word)
        following = [bounded(token) for token in tokens[position + 1 : position + 3]]
        position += 1
        if value is not None:
            (heights if "feed" in found else bare).append(value)
        elif word == "PECKING" and len(following) == 2 and None not in following:
            found["peck_first"], found["peck"] = (v or 0.0 for v in following)
            position += 2
        elif word in FEED_UNITS and following and following[0] is not None:
            found["feed"] = feed_value(state, following[0], word, line)
            position += 1
        elif word == "DWELL" and following and following[0] is not None:
            found["dwell"] = following[0]
            position += 1
        elif word not in {"G98", "G99"}:
            raise state.faults.error(
                "APT044",
                f"drill cycle: {word[:20]!r} where a minor word was expected",
                line,
                statement.text,
            )
    if bare:
        found["depth"] = bare[0]
    if heights:
        found["clearance"] = heights[0]
    if len(heights) > 1:
        found["retract"] = heights[0] if "G99" in tokens else heights[1]
    return found


def _cycle(
    state: AptState,
    kind: CycleKind,
    found: dict[str, float],
    line: int,
    statement: Statement,
    signed: bool = True,
) -> Cycle:
    """Return the cycle [m, m/s, s] from parameters in file units (feed already in m/s)."""
    depth = found.get("depth", NAN)
    if isnan(depth):
        raise state.faults.error("APT046", "a drill cycle without a depth", line, statement.text)
    if signed and state.dialect.depth_rule is DepthRule.SIGNED:
        depth = -depth
    if depth < 0.0:
        raise state.faults.error(
            "APT047",
            f"a drill cycle whose depth lies {-depth:g} above the hole",
            line,
            statement.text,
        )
    clearance = found.get("clearance", found.get("clear", NAN))
    if isnan(clearance):
        clearance = DEFAULT_CLEARANCE / state.scale
        state.faults.warn(
            "APT141", "a drill cycle without RAPTO or CLEAR: its feed starts 2 mm above", line
        )
    retract = found.get("retract", clearance)
    if clearance < 0.0 or retract < 0.0:
        raise state.faults.error(
            "APT048", "a drill cycle whose heights lie below the hole", line, statement.text
        )
    peck = abs(found.get("peck", 0.0))
    scale = state.scale
    return Cycle(
        kind=kind,
        depth=depth * scale + 0.0,
        clearance=clearance * scale,
        retract=retract * scale,
        peck_first=abs(found.get("peck_first", peck)) * scale,
        peck=peck * scale,
        break_chip=kind is CycleKind.BRKCHP,
        dwell=max(found.get("dwell", 0.0), 0.0),
        feed=found.get("feed", NAN),
        diameter=found.get("diameter", NAN) * scale,
    )


def _begin(state: AptState, cycle: Cycle, line: int) -> None:
    """Let a cycle hold from the next point on; equal cycles share one entry of the table."""
    if cycle.peck > 0.0 and cycle.kind is CycleKind.DRILL:
        cycle = replace(cycle, kind=CycleKind.DEEP)
    known = state.cycle_index.setdefault(repr(cycle), len(state.cycles))
    if known == len(state.cycles):
        state.cycles.append(cycle)
    state.cycle.set(state.at, known)
    if cycle.depth == 0.0:
        state.faults.warn("APT142", "a drill cycle with depth 0: the tool only touches", line)
