"""Families of campaigns, each a way to be wrong, and the table of each.

Within a family every case is drawn from the seed and its number alone. Judged as all others, with
some marks more: right inside the library (no wrong name outright, the largest effect in the named
set, not left unexplained, nor undetermined where the noise is told), rows of a real cause taken for
measuring faults, pages that their numbers contradict, and how many points lie in their promised
radius.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind import beyond, forms
from tools.blind.around import AROUND, UNLISTED
from tools.blind.case import Wish
from tools.blind.cases import COUNTS, granted
from tools.blind.effects import LIBRARY
from tools.blind.judging import judge
from tools.blind.running import run_all
from tools.blind.writing import write_case

Record = dict[str, Any]
Draw = Callable[[int, np.random.Generator], Wish]
USUAL = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Sizes of effects, times the usual."""
MASTERING = (3.0, 100.0)
"""Sizes of mastering errors, times the usual: 0.03 to 0.9 deg."""
_PLAIN = tuple(name for name, kind in LIBRARY.items() if not kind.loads and not kind.frames)
"""Effects that any campaign can show."""
_INSTRUMENT = ("reflector_creep", "tracker_creep", "station_bump", "tracker_wander")


def _some(names: Sequence[str], rng: np.random.Generator, count: int = 1) -> tuple[str, ...]:
    return tuple(str(name) for name in rng.choice(list(names), count, replace=False))


def _inside(number: int, rng: np.random.Generator) -> Wish:
    kind = ("one", "two", "none", "three")[number % 4]
    return Wish(kind, _some(tuple(LIBRARY), rng, COUNTS[kind]))


def _sizes(number: int, rng: np.random.Generator) -> Wish:
    count = 1 + number % 2
    sizes = rng.choice(USUAL, count)
    sizes[0] = USUAL[number % len(USUAL)]
    names = _some(tuple(LIBRARY), rng, count)
    kind = ("one", "two")[count - 1]
    return Wish(kind, names, tuple(float(s) for s in sizes), (80, 200))


def _mastering(number: int, rng: np.random.Generator) -> Wish:
    size = float(np.exp(rng.uniform(*np.log(MASTERING))))
    more = _some([n for n in _PLAIN if n != "joint_offset"], rng, number % 2)
    sizes = (size, *([float(rng.choice((1.0, 3.0)))] * len(more)))
    return Wish(("one", "two")[len(more)], ("joint_offset", *more), sizes, (30, 80))


def _few(number: int, rng: np.random.Generator) -> Wish:
    kind = ("one", "none", "two")[number % 3]
    return Wish(kind, _some(tuple(LIBRARY), rng, COUNTS[kind]), rows=(24, 60))


def _with_marks(
    names: Sequence[str],
    number: int,
    rng: np.random.Generator,
    rows: tuple[int, int],
    repeats: int,
) -> Wish:
    """Return a cause of a logged column, alone, beside a library effect, or not there at all."""
    more: Record = {"rows": rows, "repeats": repeats, "registered": False}
    name = names[number // 3 % len(names)]
    marks = tuple(c for c in ("tool_no", "fixture", "pressure_bar", "e1_mm") if _logs(name, c))
    if number % 3 == 2:
        return Wish("none", marks=marks, **more)
    beside = _some(_PLAIN, rng, number % 3)
    return Wish("mixed" if beside else "outside", (name, *beside), marks=marks, **more)


def _logs(name: str, column: str) -> bool:
    return column in AROUND[name].needs


def _conditions(number: int, rng: np.random.Generator) -> Wish:
    names = ("tool_frames", "pressure_shift", "fixture_frames")
    return _with_marks(names, number, rng, (70, 160), 24)


def _tools(number: int, rng: np.random.Generator) -> Wish:
    names = ("tool_frames", "fixture_frames")
    return _with_marks(names, number, rng, (60, 160), 0)


def _rail(number: int, rng: np.random.Generator) -> Wish:
    names = ("rail_straightness", "rail_angle", "rail_scale")
    repeats = 16 * (number % 2)
    return _with_marks(names, number, rng, (70, 160), repeats)


def _outliers(number: int, rng: np.random.Generator) -> Wish:
    return Wish("outside", (("load_click", "crash")[number % 2],), rows=(120, 300))


def _instrument(number: int, rng: np.random.Generator) -> Wish:
    name = _INSTRUMENT[number // 2 % len(_INSTRUMENT)]
    beside = _some(_PLAIN, rng, number % 2)
    return Wish("mixed" if beside else "outside", (name, *beside), rows=(80, 250), registered=True)


def _readings(number: int, rng: np.random.Generator) -> Wish:
    form = forms.FORMS[1:][number % (len(forms.FORMS) - 1)]
    names = () if number % 4 == 3 else _some(_PLAIN, rng)
    scalar = form in ("dial", "ballbar", "wire", "plane")
    return Wish(
        "one" if names else "none",
        names,
        rows=(150, 300) if scalar else (80, 200),
        repeats=0,
        form=form,
        registered=None if form in ("sigmas", "gaps") else False,
        design="patch" if form == "plane" else None,
    )


def _unlisted(number: int, rng: np.random.Generator) -> Wish:
    if number % 2:
        return _inside(number // 2 % 2, rng)
    pool = tuple(UNLISTED) if number % 4 == 0 else (*UNLISTED, *beyond.OUTSIDE)
    return Wish("outside", _some(pool, rng), rows=(90, 250))


FAMILIES: dict[str, Draw] = {
    "inside": _inside,
    "sizes": _sizes,
    "mastering": _mastering,
    "few": _few,
    "conditions": _conditions,
    "tools": _tools,
    "rail": _rail,
    "outliers": _outliers,
    "instrument": _instrument,
    "readings": _readings,
    "unlisted": _unlisted,
}


def write_family(folder: Path, name: str, count: int, seed: int) -> list[Record]:
    """Write the cases of a family and their sealed answers; return these."""
    own = 1000 * seed + list(FAMILIES).index(name)
    answers = []
    for number in range(1, count + 1):
        rng = np.random.default_rng([own, 2, number])
        case = granted(number, FAMILIES[name](number - 1, rng), rng)
        answers.append(write_case(folder / "cases" / f"{number:04d}", case, own))
    sealed = {"schema": "blind.answers/1", "seed": own, "cases": answers}
    (folder / "answers.json").write_text(json.dumps(sealed, indent=1) + "\n", encoding="utf-8")
    return answers


def run(
    folder: Path, names: Sequence[str], count: int, seed: int, jobs: int, again: bool = False
) -> str:
    """Draw families, run the product on them, and return their tables as markdown.

    Args:
        folder: gets a folder for each family, and ``families.json``.
        names: of families.
        count: cases of each.
        seed: of everything that is drawn.
        jobs: cases at a time.
        again: do not use earlier runs.
    """
    whole: dict[str, list[Record]] = {}
    for name in names:
        answers = write_family(folder / name, name, count, seed)
        records = run_all(folder / name, answers, jobs, again)
        whole[name] = [judge(a, r) for a, r in zip(answers, records, strict=True)]
    (folder / "families.json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    every = [mark for marks in whole.values() for mark in marks]
    tables = [table(name, marks) for name, marks in whole.items()]
    return "\n".join([*tables, table(f"all, seed {seed}", every)])


def _right_inside(mark: Record) -> bool | None:
    """Return whether a campaign of library effects is right."""
    if mark["kind"] not in COUNTS or mark["kind"] == "outside":
        return None
    if mark["crashed"]:
        return False
    return (
        not mark["wrong_outright"]
        and mark["main_in_set"] is not False
        and mark["verdict"] != "unexplained"
        and not (mark["noise_told"] and mark["verdict"] == "undetermined")
    )


def _near(mark: Record) -> bool | None:
    error = mark.get("shrink_error")
    return None if error is None else abs(error) <= 0.05


def _contradicted(mark: Record) -> bool | None:
    told = mark.get("contradictions")
    return None if told is None else bool(told)


MARKS: tuple[tuple[str, str, Callable[[Record], float | bool | None]], ...] = (
    ("no answer", "0", lambda m: m["crashed"]),
    ("wrong cause above 0.5", "0.03 (unlisted 0.05)", lambda m: m.get("likely_wrong")),
    ("any wrong cause", "0.06", lambda m: bool(m["wrong"]) if "wrong" in m else None),
    ("false calm", "0", lambda m: m.get("false_calm")),
    ("worse on fresh rows", "0", lambda m: m.get("worse_fresh")),
    ("worse on another design", "0", lambda m: m.get("worse_transfer")),
    ("right inside the library", "0.95", _right_inside),
    ("class right", "0.85", lambda m: m.get("class_right")),
    ("genuine rows thrown out", "0", lambda m: m.get("thrown")),
    ("shrinkage within 5 points", "0.92", _near),
    ("its interval holds", "0.85 to 0.97", lambda m: m.get("shrink_covered")),
    ("pages that numbers contradict", "0", _contradicted),
    ("points in their radius, fresh", "0.92 to 0.98", lambda m: m.get("held_fresh")),
    ("points in their radius, other design", "0.92 to 0.98", lambda m: m.get("held_transfer")),
)
"""Mark, goal, and what a case says of it."""


def table(name: str, marks: Sequence[Record]) -> str:
    """Return the table of a family, and its failures."""
    lines = [
        f"## {name}: {len(marks)} cases",
        "",
        "| mark | goal | share | of |",
        "|---|---|--:|--:|",
    ]
    for title, goal, of in MARKS:
        known = [float(v) for m in marks if (v := of(m)) is not None]
        share = f"{np.mean(known):.2f}" if known else "-"
        lines.append(f"| {title} | {goal} | {share} | {len(known)} |")
    lines.append("")
    faults: Counter[str] = Counter()
    for mark in marks:
        faults.update(set(mark.get("faults") or (["no answer"] if mark["crashed"] else [])))
    lines += [f"- {number} x {fault}" for fault, number in faults.most_common(12)]
    return "\n".join(lines) + "\n"
