"""The parameters of drill cycles by name, out of each seat's words and positions.

Names: ``depth`` ``feed`` [m/s] ``feed_per_turn`` [m] ``clearance`` (feed starts so high above the
point) ``clear`` (the seat's CLEAR, or the number that stands for it) ``rapto`` ``retract``
``return`` ``peck`` ``peck_first`` ``dwell`` [s] ``dwell_turns`` ``shift`` ``orient`` [deg]
``pitch`` ``repeat`` ``diameter`` ``angle`` [deg]; lengths in units of the file.
"""

from __future__ import annotations

from collections.abc import Container
from math import radians, tan

from postproc.model import WordClass
from postproc.readers.apt.dialect import CycleGrammar
from postproc.readers.apt.feed import feed_per_turn, feed_value, is_feed_unit, is_per_turn
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded

Found = dict[str, float]

_FIELDS = {
    "FEDTO": "depth", "DEPTH": "depth", "RAPTO": "rapto", "CLEAR": "clear",
    "RTRCTO": "retract", "RETURN": "return", "STEP": "peck", "INCR": "peck",
    "1STPECK": "peck_first", "SUBPECK": "peck", "DWELL": "dwell", "DWELL,REV": "dwell_turns",
    "CSKDIA": "diameter",
    "ORIENT": "orient", "ORIANT": "orient", "SHIFT": "shift", "PITCH": "pitch", "LEAD": "pitch",
    "TIMES": "repeat", "REPEAT": "repeat",
}  # fmt: skip
"""Minor words of the parameters; each is followed by one number."""
_SECOND = {"FEDTO": "angle", "DEPTH": "angle", "CLEAR": "shift"}
"""What a bare number behind the first one is: CSINK,FEDTO,diameter,angle; BORE,CLEAR,c,shift."""
_MODIFIERS = frozenset({"DEEP", "BRKCHP", "REVERS", "TAP", "RIGID", "AUTO", "NONE"})
_HARMLESS = frozenset({"MINSTP", "CSINK"})
_REFUSED = {
    "CAM": "calls a function of the target control", "LOCK": "acts on the target control",
    "PULBAC": "acts on the target control", "AVOID": "moves around obstacles by the control",
    "MANUAL": "stops for work by hand", "OFFSET": "moves the tool off the wall",
    "PARAMS": "gives parameters of the target control",
}  # fmt: skip


def parameters(state: AptState, statement: Statement) -> Found:
    """Return the parameters of CYCLE/type,... in the grammar of the dialect."""
    grammar = state.dialect.cycle_grammar
    words = statement.upper
    positional = len(words) > 1 and bounded(words[1]) is not None
    if grammar is CycleGrammar.CAMWORKS:
        return _camworks(state, words)
    catia = grammar is CycleGrammar.CATIA or (
        grammar is CycleGrammar.UNKNOWN and is_catia_order(words)
    )
    if positional and (state.options.cycle_words is not None or catia):
        return _named(state, words)
    if positional and grammar is not CycleGrammar.WORDS:
        return _by_position(state, words)
    return _by_words(state, words)


def is_hsm_order(words: tuple[str, ...]) -> bool:
    """Return whether numbers stand as HSM writes them: depth[, INCR, i], unit, feed, clearance."""
    at = next((i for i, word in enumerate(words) if is_feed_unit(word)), 0)
    numbers = [bounded(word) for word in words[at + 1 : at + 3]]
    return at > 1 and len(numbers) == 2 and None not in numbers


def is_catia_order(words: tuple[str, ...]) -> bool:
    """Return whether the unit of the feed stands last, as CATIA writes it."""
    return is_feed_unit(words[-1])


class _Tokens:
    """The words of a statement, taken one by one."""

    def __init__(self, words: tuple[str, ...]) -> None:
        self._words = words
        self._at = 0

    def __bool__(self) -> bool:
        return self._at < len(self._words)

    def take(self) -> str:
        self._at += 1
        return self._words[self._at - 1]

    def number(self) -> float | None:
        """Return the next word if it is a number, and take it."""
        value = bounded(self._words[self._at]) if self else None
        self._at += value is not None
        return value

    def skip(self, word: str) -> bool:
        """Take the next word if it is this one."""
        found = bool(self) and self._words[self._at] == word
        self._at += found
        return found


def _by_words(state: AptState, words: tuple[str, ...]) -> Found:
    """Return the parameters of minor words, each followed by its number."""
    found: Found = {}
    tokens = _Tokens(words[1:])
    while tokens:
        word = tokens.take()
        if bounded(word) is None:
            _minor(state, found, word, tokens)
        else:
            text = f"drill cycle: {word[:20]!r} where a minor word was expected"
            raise state.error("APT044", text)
    return _countersunk(state, found, words[0])


def _minor(state: AptState, found: Found, word: str, tokens: _Tokens) -> None:
    """Take one minor word with its number."""
    value = tokens.number()
    if word == "DWELL" and value is None and tokens.skip("REV"):
        value, word = tokens.number(), "DWELL,REV"
    if is_feed_unit(word) or word == "TPI":
        if value is None:
            raise _no_number(state, word)
        _take_feed(state, found, word, value)
        above = tokens.number()
        if above is not None:
            found["clear"] = above
    elif word in _FIELDS and value is not None:
        _check_value(state, found.get(_FIELDS[word], value), word, value)
        found[_FIELDS[word]] = value
        _take_second(state, found, word, tokens)
    elif word in _MODIFIERS or (word in {"DWELL", "RETURN", "ORIENT", "RTRCTO"} and value is None):
        tokens.skip("AUTO")
        tokens.skip("NONE")
    elif word in _FIELDS:
        raise _no_number(state, word)
    elif word in _HARMLESS:
        state.note(f"CYCLE/{word}", WordClass.PROCESS, "not needed for the stroke")
    else:
        reason = _REFUSED.get(word, "is not known; the cycle is read without it")
        state.refuse(f"CYCLE/{word[:20]}", WordClass.PROCESS, f"{word[:20]} {reason}")
        while tokens.number() is not None:
            pass


def _check_value(state: AptState, before: float, word: str, value: float) -> None:
    """Ask a number back that contradicts the one ``before``, or that nothing can take."""
    reason = ""
    if value != before:
        reason = f"{word} is given twice, {before:g} and {value:g}"
    elif _FIELDS[word].startswith("dwell") and value < 0.0:
        reason = f"a dwell of {value:g}; none is made"
    if reason:
        state.refuse(f"CYCLE/{word.partition(',')[0]}", WordClass.PROCESS, reason)


def _no_number(state: AptState, word: str) -> Exception:
    return state.error("APT043", f"{word} of a drill cycle has no number")


def _take_second(state: AptState, found: Found, word: str, tokens: _Tokens) -> None:
    """Take what may stand behind the number of a minor word: REV, or a second number."""
    if word == "DWELL" and tokens.skip("REV"):
        found["dwell_turns"] = found.pop("dwell")
    second = tokens.number()
    if second is None:
        return
    if word in _SECOND:
        found[_SECOND[word]] = second
        return
    reason = f"a second number behind {word}, {second:g}, is not carried out"
    state.refuse(f"CYCLE/{word}", WordClass.PROCESS, reason)


def _take_feed(state: AptState, found: Found, unit: str, value: float) -> None:
    if unit == "TPI":
        found["pitch"] = value if value < 1.0 else 1.0 / value
        return
    if is_per_turn(unit):
        found["feed_per_turn"] = feed_per_turn(state, value, unit)
    else:
        found["feed"] = feed_value(state, value, unit)


def _countersunk(state: AptState, found: Found, first: str) -> Found:
    """Turn diameter and included angle of a countersink into its depth."""
    angle = found.pop("angle", 0.0)
    if angle and first == "CSINK" and 0.0 < angle < 180.0:
        found["diameter"] = found["depth"]
        found["depth"] = 0.5 * found["depth"] / tan(0.5 * radians(angle))
    elif angle:
        reason = f"a second number behind the depth, {angle:g}, is not carried out"
        state.refuse(f"CYCLE/{first}", WordClass.PROCESS, reason)
    return found


def _by_position(state: AptState, words: tuple[str, ...]) -> Found:
    """Return depth[, INCR, i], unit, feed, clearance[, shift], or SURFCAM's order of them."""
    surfcam = state.dialect.cycle_grammar is CycleGrammar.SURFCAM or not is_hsm_order(words)
    names = ["depth", "feed", "clear"] if surfcam else ["depth", "feed", "clear", "shift"]
    return _in_order(state, words, names, None)


def _named(state: AptState, words: tuple[str, ...]) -> Found:
    """Return the parameters of numbers that ``ReadOptions.cycle_words`` names in their order."""
    minor = () if state.options.cycle_words is None else _FIELDS
    return _in_order(state, words, list(state.options.cycle_numbers), minor)


def _in_order(
    state: AptState, words: tuple[str, ...], names: list[str], minor: Container[str] | None
) -> Found:
    """Return numbers by names in their order, those of ``minor`` words between (None: of all)."""
    unit = next((word for word in words[1:] if is_feed_unit(word)), "PERMIN")
    found: Found = {}
    tokens = _Tokens(words[1:])
    while tokens:
        word = tokens.take()
        value = bounded(word)
        if is_feed_unit(word):
            continue
        if value is None and (minor is None or word in minor):
            _minor(state, found, word, tokens)
            continue
        if value is None or not names:
            text = f"drill cycle: the meaning of {word[:20]!r} is not known"
            raise state.error("APT045", text, "name the positions with --cycle-words")
        name = names.pop(0)
        if name == "feed":
            _take_feed(state, found, unit, value)
        elif name != "-":
            found[name] = value
    return found


def _camworks(state: AptState, words: tuple[str, ...]) -> Found:
    """Return the parameters of CAMWorks' order; the comma between two heights may be missing.

    G98, depth[, PECKING, first, next], MMPM, feed, rapid height, retract height, initial height,
    DWELL, time.
    """
    tokens = _Tokens(tuple(part for word in words[1:] for part in word.split()))
    found: Found = {}
    bare: list[float] = []
    heights: list[float] = []
    low = False
    while tokens:
        word = tokens.take()
        value = bounded(word)
        if value is not None:
            (heights if "feed" in found else bare).append(value)
        elif word in {"G98", "G99"}:
            low = word == "G99"
        else:
            _camworks_word(state, found, word, tokens)
    if bare:
        found["depth"] = bare[0]
    if heights:
        found["clearance"] = heights[0]
    if len(heights) > 1:
        found["retract"] = heights[0] if low else heights[1]
    return found


def _camworks_word(state: AptState, found: Found, word: str, tokens: _Tokens) -> None:
    first = tokens.number()
    if word == "PECKING" and first is not None and (second := tokens.number()) is not None:
        found["peck_first"], found["peck"] = first, second
    elif is_feed_unit(word) and first is not None:
        _take_feed(state, found, word, first)
    elif word == "DWELL" and first is not None:
        found["dwell"] = first
    else:
        raise state.error("APT044", f"drill cycle: {word[:20]!r} where a minor word was expected")
