"""How far a campaign can be relied on: effects are put into its own rows and withheld.

Each effect that the rows can show gets numbers as arms have them, times a size. An arm that has
this effect and no other is read in the same poses, under the same loads and conditions, by the same
instrument, and diagnosed by the same function, which is told nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.cell import Cell
from postproc.gap import (
    Diagnosis,
    Effect,
    Kind,
    RobotModel,
    Samples,
    State,
    act,
    diagnose,
    document,
    effect_of,
    model_file,
    pose_problem,
)
from postproc.geometry import apply
from postproc.kinematics import Kinematics, build
from postproc.measurement import frames_of, rigid_motion
from postproc.model import ModelFile
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.units import DEG

SIZES = (0.3, 1.0, 3.0)
"""Sizes of each effect, times what is usual."""
_ELSEWHERE = 5.0 * DEG
"""How far the poses on which the truth is compared lie from those that were measured, per joint."""
_SEED = 44


@dataclass(frozen=True, slots=True)
class _Bench:
    """The campaign that effects are put into.

    diagnosis: of its own rows; kinematics, cell, given: of the robot.
    """

    diagnosis: Diagnosis
    kinematics: Kinematics
    cell: Cell
    given: ModelFile | None

    def trial(self, effect: Effect, size: float, rng: np.random.Generator) -> dict[str, Any]:
        """Return what is said of an arm with an effect, and what comes of it."""
        problem = self.diagnosis.problem
        state = _drawn(effect, problem.samples, size, rng)
        hidden = [*((effect_of(n), s) for n, s in problem.given.items()), (effect, state)]
        points = act(problem.samples, hidden)[0]
        frame = problem.registration
        fixed = frame is None and self.given is not None and self.given.registration is not None
        known = self.given.registration if fixed and self.given else frame
        if known is not None:
            points = apply(frames_of(known, problem.set_ups), points)
        read = points + rng.normal(0.0, self.diagnosis.noise, points.shape)
        rows = replace(problem.measurements, position=read)
        found = diagnose(
            pose_problem(rows, self.kinematics, self.cell, self.given, frame is not None)
        )
        told = _sets(found)
        before, after = found.total[:2]
        true = self._elsewhere(found, hidden, rng)
        return {
            "named": any(effect.name in names for names in told),
            "blamed": [names[0] for names in told if not _covers(effect, names)],
            "shrinkage": 1.0 - after / before,
            "true_shrinkage": 1.0 - true[1] / true[0],
        }

    def _elsewhere(
        self, found: Diagnosis, hidden: list[tuple[Effect, State]], rng: np.random.Generator
    ) -> tuple[float, float]:
        """Return the 3D rms [m] at other poses before and after, noise of a reading included."""
        samples = self.diagnosis.problem.samples
        samples = samples.at(samples.q + rng.normal(0.0, _ELSEWHERE, samples.q.shape))
        truth = act(samples, hidden)[0]
        frame = found.problem.registration is not None
        left = []
        for model in (self.given, model_file(found, self.given, self.cell.tool)):
            robot = RobotModel.of(self.kinematics, self.cell, model)
            states = [(effect_of(n), s) for n, s in robot.usable(samples).items()]
            points = act(samples, states)[0]
            if frame:  # of which the rows decide anew
                points = apply(rigid_motion(points, truth), points)
            square = np.mean(np.sum((points - truth) ** 2, axis=1))
            left.append(float(np.sqrt(square + 3.0 * self.diagnosis.noise**2)))
        return left[0], left[1]


def self_check(
    diagnosis: Diagnosis,
    cell: Cell,
    given: ModelFile | None = None,
    trials: int = 1,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Return for each effect and size how often it was named, missed, and what was blamed.

    ``diagnosis`` of the campaign's own rows, ``given`` what the simulation knows already,
    ``trials`` arms of each effect and size.
    """
    bench = _Bench(diagnosis, build(cell.robot), cell, given)
    wanted = list(_shown(diagnosis))
    rng = np.random.default_rng(_SEED)
    found = []
    for k, effect in enumerate(wanted):
        for size in SIZES:
            if progress is not None:
                progress(k, len(wanted), f"{effect.name} at {size:g} times the usual")
            marks = [bench.trial(effect, size, rng) for _ in range(trials)]
            found.append({"effect": effect.name, "size": size} | _shares(marks))
    return found


def _shown(diagnosis: Diagnosis) -> Iterator[Effect]:
    """Yield the causes that the rows can show and the given model does not have."""
    problem = diagnosis.problem
    for effect in problem.effects:
        frames = effect.kind is Kind.REGISTRATION and problem.registration is not None
        if effect.is_alternative or frames or effect.of_several or effect.name in problem.given:
            continue
        yield effect


def _drawn(effect: Effect, samples: Samples, size: float, rng: np.random.Generator) -> State:
    """Return numbers as arms have them, times a size, of one variant of an effect."""
    settings = list(effect.variants(effect.prepare(samples)).values())
    setting = settings[int(rng.integers(len(settings)))]
    parameters = effect.parameters(samples.arm, setting)
    typical = np.array([p.typical for p in parameters])
    theta = size * typical * effect.drawn(rng.normal(size=(1, len(parameters))))[0]
    low, high = np.array([[p.lower, p.upper] for p in parameters]).T
    return State(np.clip(theta, low, high), setting)


def _sets(found: Diagnosis) -> list[tuple[str, ...]]:
    """Return each adopted name with those that it cannot be told from."""
    told = document(found)["effects"]
    return [(item["name"], *item["confounded_with"]) for item in told if item["adopted"]]


def _covers(effect: Effect, names: tuple[str, ...]) -> bool:
    """Return whether a set holds an effect, or what that describes more closely."""
    return not {effect.name, *effect.refines}.isdisjoint(names)


def _shares(marks: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the shares over some trials."""
    n = len(marks)
    named = sum(mark["named"] for mark in marks) / n
    blamed = Counter(name for mark in marks for name in set(mark["blamed"]))
    return {
        "named": round(named, 3),
        "missed": round(1.0 - named, 3),
        "blamed": [{"name": name, "share": round(c / n, 3)} for name, c in sorted(blamed.items())],
        "shrinkage": round(float(np.mean([m["shrinkage"] for m in marks])), 4),
        "true_shrinkage": round(float(np.mean([m["true_shrinkage"] for m in marks])), 4),
    }


def reliability(checked: list[dict[str, Any]]) -> list[str]:
    """Return a self-check in words, a line for each effect."""
    lines = ["How far these rows can be relied on (effects put in at some times the usual size):"]
    for name in dict.fromkeys(item["effect"] for item in checked):
        parts = []
        for item in (one for one in checked if one["effect"] == name):
            blamed = ", ".join(one["name"] for one in item["blamed"])
            beside = f", blamed on {blamed}" if blamed else ""
            parts.append(f"{item['size']:g} x named {100 * item['named']:.0f} %{beside}")
        lines.append(f"  {name}: {'; '.join(parts)}.")
    return lines
