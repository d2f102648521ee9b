"""Cases: which effects are hidden in which campaign, how large, and what counts as the truth.

A case is drawn from ``default_rng([seed, number])`` alone. Sizes are the rms per axis that an
effect adds beside all others, divided by the noise; where the campaign is registered, what a
rigid motion of the measured frame and another reflector place imitate does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tools.blind.beyond import BEYOND, OUTSIDE, kind_of, make
from tools.blind.campaign import DESIGNS, Plan, drive
from tools.blind.case import Case, Entry, Wish
from tools.blind.effects import LIBRARY, STRONGEST, place_reflector
from tools.blind.robots import CLASSES
from tools.blind.sizes import HIDING, contribution, difference, own_part
from tools.blind.world import Hidden, simulate

CLASS_SHARES = {"none": 0.2, "one": 0.3, "two": 0.2, "three": 0.1, "outside": 0.2}
COUNTS = {"none": 0, "one": 1, "two": 2, "three": 3, "outside": 0}


class _AnotherDrawError(Exception):
    """The drawn effects cannot reach their sizes in the drawn campaign."""


def kinds(count: int, seed: int) -> list[str]:
    """Return the kind of every case, in the shares of the benchmark, shuffled."""
    names: list[str] = []
    for name, share in CLASS_SHARES.items():
        names += [name] * round(share * count)
    names = (names + ["one"] * count)[:count]
    order = np.random.default_rng([seed, 0]).permutation(count)
    return [names[k] for k in order]


def wanted(all_kinds: Sequence[str], seed: int) -> list[tuple[str, ...]]:
    """Return the effects of every case, each name of the library and beyond equally often."""
    rng = np.random.default_rng([seed, 1])
    library, outside = _Deck(tuple(LIBRARY), rng), _Deck((*OUTSIDE, "hidden_column"), rng)
    return [
        (outside.card(),) if kind == "outside" else library.hand(COUNTS[kind]) for kind in all_kinds
    ]


class _Deck:
    """Names dealt evenly."""

    def __init__(self, names: tuple[str, ...], rng: np.random.Generator) -> None:
        self.names, self.rng, self.left = names, rng, []

    def card(self) -> str:
        if not self.left:
            self.left = [self.names[k] for k in self.rng.permutation(len(self.names))]
        return str(self.left.pop())

    def hand(self, count: int) -> tuple[str, ...]:
        hand: list[str] = []
        while len(hand) < count:
            card = self.card()
            if card in hand:
                self.left.insert(0, card)
                continue
            hand.append(card)
        return tuple(hand)


def draw(number: int, kind: str, names: tuple[str, ...], seed: int) -> Case:
    """Return a case.

    Raises:
        RuntimeError: if no campaign shows the wanted effects.
    """
    return granted(number, Wish(kind, names), np.random.default_rng([seed, 2, number]))


def granted(number: int, wish: Wish, rng: np.random.Generator) -> Case:
    """Return a case as wished; raises as ``draw``."""
    for _ in range(200):
        try:
            return _attempt(number, wish, rng)
        except _AnotherDrawError:
            continue
    raise RuntimeError(f"case {number}: no campaign shows {', '.join(wish.names)}")


def _attempt(number: int, wish: Wish, rng: np.random.Generator) -> Case:
    kind, names = wish.kind, wish.names
    dropped: tuple[str, ...] = ()
    unseen = names == ("hidden_column",)
    if unseen:
        names = (str(rng.choice(list(HIDING))),)
        dropped = HIDING[names[0]]
    sorts = [kind_of(name) for name in names]
    small = not any(sort.builtin_only for sort in sorts)
    robot = CLASSES[int(rng.choice(3, p=[0.5, 0.25, 0.25] if small else [0.65, 0.35, 0.0]))]
    registered = bool(rng.random() < 0.5) and not any(sort.frames for sort in sorts)
    registered = registered or any(sort.registered for sort in sorts)
    registered = registered if wish.registered is None else wish.registered
    plan = _wished(wish, _plan(names, any(sort.loads for sort in sorts), rng), rng)
    if unseen:  # what looks like noise is told from it by rows measured again, not otherwise
        plan = replace(plan, repeats=max(plan.repeats, 20), rows=max(plan.rows, 90))
    rows = drive(robot, plan, rng)
    case = Case(
        number=number,
        kind=kind,
        robot=robot,
        plan=plan,
        rows=rows,
        entries=(),
        sigma=float(np.exp(rng.uniform(np.log(1.5e-5), np.log(8e-5)))),
        outliers=float(rng.choice([0.0, 0.01, 0.02])),
        registered=registered,
        dropped=dropped or _needless(names, rng),
        stiffness=None,
        known=None,
        form=wish.form,
    )
    case = _with_model(case, names, rng)
    case = _with_effects(case, names, rng) if wish.sizes is None else _with_sizes(case, wish, rng)
    return _with_background(case, names, rng)


def _plan(names: tuple[str, ...], loads: bool, rng: np.random.Generator) -> Plan:
    weights = np.array([0.35, 0.25, 0.2, 0.2])
    if loads:
        weights = np.array([0.6, 0.0, 0.2, 0.2])
    design = str(rng.choice(DESIGNS, p=weights / weights.sum()))
    kind = {"wide_loads": "three", "wide_noload": "none"}.get(design, "none")
    if design in ("patch", "grid") and (loads or rng.random() < 0.5):
        kind = "one" if design == "patch" else "three"
    rows = int(np.exp(rng.uniform(np.log(60), np.log(500))))
    if not names and rng.random() < 0.3:
        rows = int(rng.integers(24, 60))
    if len(names) > 1:
        rows = max(rows, 110)
    return Plan(
        design=design,
        rows=rows,
        loads=kind,
        level=float(np.exp(rng.uniform(np.log(0.25), 0.0))),
        moving="servo_lag" in names or rng.random() < 0.12,
        repeats=min(int(rng.integers(10, 41)), rows // 4) if rng.random() < 0.5 else 0,
        both_sides=bool(rng.random() < 0.3),
        warming=float(rng.uniform(6, 14) if "thermal_drift" in names else rng.uniform(0.5, 8)),
        slow=float(rng.uniform(1800, 5400)),
    )


def _wished(wish: Wish, plan: Plan, rng: np.random.Generator) -> Plan:
    rows = plan.rows if wish.rows is None else int(rng.integers(wish.rows[0], wish.rows[1] + 1))
    repeats = plan.repeats if wish.repeats is None else wish.repeats
    plan = replace(plan, rows=rows, repeats=min(repeats, rows // 4), marks=wish.marks)
    if wish.design is None:
        return plan
    return replace(plan, design=wish.design, loads="none" if plan.loads == "none" else "one")


def _needless(names: tuple[str, ...], rng: np.random.Generator) -> tuple[str, ...]:
    """Return optional columns that this campaign did not log and nobody needs."""
    needed = {column for name in names for column in kind_of(name).needs}
    some = ("dir", "qd", "time_s", "temp_C")
    return tuple(name for name in some if name not in needed and rng.random() < 0.2)


def _with_model(case: Case, names: tuple[str, ...], rng: np.random.Generator) -> Case:
    """Decide what the product is told of the joint stiffness: in the cell, in a model, nothing."""
    give = case.robot.arm.give * np.exp(rng.normal(0, 0.15, 6))
    case = replace(case, robot=replace(case.robot, arm=replace(case.robot.arm, give=give)))
    told = 1.0 / (give * np.exp(rng.normal(0, 0.12, 6)))
    if "payload_error" in names or rng.random() < 0.6:
        case = replace(case, stiffness=told)
    loaded = case.plan.loads != "none" and "wrench" not in case.dropped
    if not loaded or "joint_compliance" in names or "hardening" in names:
        return case
    if rng.random() < (0.4 if names else 0.8):
        stiff = Hidden(
            "joint_compliance",
            {"factor": np.ones(6), "hardening": np.zeros(1)},
            1.0,
            LIBRARY["joint_compliance"].change,
        )
        return replace(case, known=1.0 / give, entries=(Entry(stiff, "known"),))
    return case


def _with_effects(case: Case, names: tuple[str, ...], rng: np.random.Generator) -> Case:
    """Add the planned effects at sizes of 6 to 22 times the noise, the carrier included."""
    carrier = case.plan.loads != "none" and case.known is None
    if carrier and not {"joint_compliance", "hardening"} & set(names):
        case = _with_carrier(case, names, rng)
    sizes = np.exp(rng.uniform(np.log(6), np.log(22), len(names)))
    for name, size in zip(names, sizes, strict=True):
        case = _grown(case, make(name, rng, case.robot, case.rows), "planned", float(size))
    for entry in case.entries:
        if entry.role != "planned":
            continue
        size = contribution(case, entry)
        part = own_part(case, difference(case, entry)) if entry.effect.name in BEYOND else size
        if size < 4.0 * case.sigma or part < 3.5 * case.sigma:
            raise _AnotherDrawError
    return case


def _with_sizes(case: Case, wish: Wish, rng: np.random.Generator) -> Case:
    """Add the effects at multiples of their usual size, as far as physics lets them."""
    if case.plan.loads != "none" and case.known is None and "joint_compliance" not in wish.names:
        case = _with_carrier(case, wish.names, rng)
    for name, size in zip(wish.names, wish.sizes or (), strict=True):
        most = kind_of(name).strength[1]
        factor = size if most == STRONGEST else min(size, most)
        effect = make(name, rng, case.robot, case.rows).scaled(factor)
        case = replace(case, entries=(*case.entries, Entry(effect, "planned")))
    try:
        simulate(case.robot, case.rows, case.hidden)
    except ArithmeticError:
        raise _AnotherDrawError from None
    return case


def _with_carrier(case: Case, names: tuple[str, ...], rng: np.random.Generator) -> Case:
    """Let the arm give under its loads: as it is for effects of loads, else at a tenth."""
    effect = make("joint_compliance", rng, case.robot, case.rows)
    entry = Entry(effect, "carrier")
    case = replace(case, entries=(*case.entries, entry))
    if any(kind_of(name).loads for name in names):
        return case
    size = contribution(case, entry)
    goal = case.sigma * rng.uniform(0.4, 2.0) if names else 0.05 * case.sigma
    rows = replace(case.rows, force=case.rows.force * min(1.0, goal / max(size, 1e-12)))
    return replace(case, rows=rows)


def _with_background(case: Case, names: tuple[str, ...], rng: np.random.Generator) -> Case:
    """Add errors of geometry and registration, and the reflector of a registered campaign."""
    main = max((contribution(case, e) for e in case.entries if e.role == "planned"), default=0.0)
    geometry = {"joint_offset", "link_geometry"} & set(names)
    for name in ("joint_offset", "link_geometry", "base_frame", "tool_frame"):
        frame = name.endswith("_frame")
        if name in names or (geometry and not frame) or (case.registered and frame):
            continue
        large = main > 0.0 and rng.random() < (0.2 if not frame else 0.3)
        size = rng.uniform(3e-5, 1.7e-4) if large else case.sigma * rng.uniform(0.02, 0.2)
        case = _grown(
            case,
            make(name, rng, case.robot, case.rows),
            "background",
            min(size, 0.6 * main if main else size) / case.sigma,
            free=True,
        )
    if case.registered:
        place = Hidden("reflector", {"shift": rng.uniform(-0.06, 0.06, 3)}, 1.0, place_reflector)
        case = replace(case, entries=(*case.entries, Entry(place, "setup")))
    return case


def _grown(case: Case, effect: Hidden, role: str, size: float, free: bool = False) -> Case:
    """Return the case with the effect at ``size`` times the noise, within its real strengths.

    Raises:
        _AnotherDrawError: if that size is far beyond what the effect can be.
    """
    goal = min(size * case.sigma, 6e-4)
    low, high = (0.0, np.inf) if free else kind_of(effect.name).strength
    for _ in range(3):
        trial = replace(case, entries=(*case.entries, Entry(effect, role)))
        try:
            now = contribution(trial, trial.entries[-1])
        except ArithmeticError:
            raise _AnotherDrawError from None
        factor = float(
            np.clip(goal / max(now, 1e-12), low / effect.strength, high / effect.strength)
        )
        effect = effect.scaled(factor)
        if abs(factor - 1.0) < 0.02:
            break
    return replace(case, entries=(*case.entries, Entry(effect, role)))
