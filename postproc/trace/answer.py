"""The answer to a recording: stages in order, what each shows, and what is left where."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import DataError, SourceRef
from postproc.kinematics import Kinematics
from postproc.model import ModelFile
from postproc.progress import Clock, Progress
from postproc.records import dataclass
from postproc.trace.contour import contour_error
from postproc.trace.effect import JOINTS, LINK, PATH_EFFECTS, PROGRAM, TOOL, WHOLE, known_effects
from postproc.trace.evidence import PROBABLE, STRETCHES, WHOLE_RUNS, Verdict, judged, withheld
from postproc.trace.fit import values_of
from postproc.trace.planner import Planned, asked, less_known
from postproc.trace.program import Programmed, matched
from postproc.trace.recording import Recording
from postproc.trace.scene import Scene, Stage, carried
from postproc.trace.signals import MEANS, means, octaves, white_sigma
from postproc.units import MM

NOISE_LIKE = 0.5
"""Rest with a memory, against the noise of one row, below which it counts as noise."""
SHRINKS = 0.02
"""Least share by which an effect shrinks the gap on rows that were not fitted."""
OUTWEIGHS = 0.5
"""Share from which an effect is larger than what is left beside it."""
SURE = (0.05, 0.95)
"""Ends of the intervals."""
DRAWS = 400
_SEED = 1


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """An effect on rows that were not fitted: root mean squares [m] before and after it.

    Args:
        name, stage: of the effect.
        before, after: root mean squares; interval: of what it shrinks.
        beside: [m] what is left unexplained in the octaves in which the effect acts.
    """

    name: str
    stage: str
    before: float
    after: float
    interval: tuple[float, float]
    beside: float = 0.0

    @property
    def outweighs(self) -> float:
        """Share of the effect in what it removes and what is left where it acts.

        An unknown cause of the size of the rest may look like an effect of that size.
        """
        gain = max(0.0, self.before**2 - self.after**2)
        return gain / (gain + self.beside**2) if gain > 0.0 else 0.0

    @property
    def shrinkage(self) -> float:
        """1 less after over before."""
        return 1.0 - self.after / self.before if self.before > 0.0 else 0.0


class PathDiagnosis:
    """What a recording shows.

    Args:
        recording: all rows; cell, kinematics: of its arm.
        model: what is known already; its effects are taken off before anything is judged.
        progress: told the stages.
        program: the path that was programmed, None where it is not known.
    """

    def __init__(
        self,
        recording: Recording,
        cell: Cell,
        kinematics: Kinematics,
        model: ModelFile | None = None,
        progress: Progress | None = None,
        program: Programmed | None = None,
    ) -> None:
        self.recording = recording
        self.cell = cell
        self.tool = np.asarray(cell.tool.T_flange_tcp[:3, 3])
        self.scene = Scene(recording, kinematics, self.tool)
        self._clock = Clock("kinematics", progress)
        self.stages = self._stages(kinematics)
        if not self.stages and program is None:
            raise DataError(
                "TRC006",
                "nothing was measured beside the command, expected q1_act_deg ... or x_mm, y_mm,"
                " z_mm",
                SourceRef(recording.path),
            )
        self.known = {} if model is None else known_effects(model)
        self.match = self._programmed = None if program is None else matched(self.scene, program)
        self.known_of_planner: tuple[str, ...] = ()
        if self.match is not None and model is not None:
            self.match, self.known_of_planner = less_known(self.scene, self.match, model)
        self.planned: list[Planned] = []
        if self.match is not None:
            self._clock.begin("program")
            self.planned = asked(self.scene, self.match)
        self._known: dict[str, FloatArray] = {}
        present = [stage.name for stage in self.stages]
        for k, stage in enumerate(self.stages):
            known = self._known_at(stage, present)
            values = values_of(stage, known)
            off = sum(values.values(), np.zeros_like(stage.gap))
            self.stages[k] = Stage(stage.name, stage.scene, stage.gap - off, known)
            self._known |= {name: stage.at_tool(value) for name, value in values.items()}

    @cached_property
    def as_programmed(self) -> dict[str, Planned]:
        """Effects of the planner, by name, as they are if none is known."""
        match = self._programmed
        return {} if match is None else {p.name: p for p in asked(self.scene, match)}

    @cached_property
    def verdicts(self) -> list[Verdict]:
        """What each stage shows."""
        found = []
        for stage in self.stages:
            self._clock.begin(f"effects at the {stage.name}")
            found.append(judged(stage))
        self._clock.begin("proof")
        return found

    def _stages(self, kinematics: Kinematics) -> list[Stage]:
        recording, scene = self.recording, self.scene
        stages = []
        if recording.actual is not None:
            stages.append(Stage(JOINTS, scene, (recording.actual - recording.command).T))
        if recording.link is not None and recording.actual is not None:
            seen = np.isfinite(recording.link).any(axis=0)
            last = int(np.flatnonzero(seen)[-1]) + 1
            gap = np.nan_to_num(recording.link - recording.actual)[:, :last]
            stages.append(Stage(LINK, scene, gap.T))
        if recording.point is not None:
            at = recording.command if recording.actual is None else recording.actual
            reference = Scene(recording, kinematics, self.tool, at)
            gap = recording.point - carried(kinematics, at, self.tool)
            name = WHOLE if recording.actual is None else TOOL
            stages.append(Stage(name, reference, gap.T))
        return stages

    def _known_at(self, stage: Stage, present: list[str]) -> dict[str, FloatArray]:
        """Return the known effects that enter first at a stage, of those there are."""
        first = {
            name: next((s for s in present if s in PATH_EFFECTS.get(name).stages), None)
            for name in self.known
        }
        return {name: theta for name, theta in self.known.items() if first[name] == stage.name}

    @cached_property
    def gap(self) -> FloatArray:
        """(n, 3) [m] of the tool point: measured, else of the joints carried to it; less known."""
        off = np.zeros_like(self.scene.points) if self.match is None else self.match.off
        total: FloatArray = np.array(off)
        for number, stage in enumerate(self.stages):
            is_whole = np.isfinite(stage.gap).all()
            gap = stage.gap if is_whole else _filled(stage, self.verdicts[number])
            total = total + stage.at_tool(gap)
        return total

    @cached_property
    def explained(self) -> dict[str, FloatArray]:
        """Value (n, 3) [m] of each adopted effect over all rows."""
        found: dict[str, FloatArray] = {
            p.name: p.value for p in self.planned if p.is_place and p.name in self.adopted
        }
        for stage, verdict in zip(self.stages, self.verdicts, strict=True):
            thetas = {n: verdict.fitted.thetas[n] for n in self.adopted if n in verdict.adopted}
            for name, value in values_of(stage, thetas).items():
                found[name] = found.get(name, np.zeros(1)) + stage.at_tool(value)
        return found

    @cached_property
    def rest(self) -> FloatArray:
        """(n, 3) [m] what the adopted effects leave."""
        return self.gap - sum(self.explained.values(), np.zeros_like(self.gap))

    @cached_property
    def adopted(self) -> tuple[str, ...]:
        """Names, in order of how much of the gap they remove."""
        good = [p for p in self.proofs if p.name in self._named and self._holds(p)]
        good.sort(key=lambda p: p.after**2 - p.before**2)
        return tuple(dict.fromkeys(p.name for p in good))

    @property
    def _named(self) -> set[str]:
        likely = {p.name for p in self.planned if p.probability >= PROBABLE}
        return likely | {name for verdict in self.verdicts for name in verdict.adopted}

    @staticmethod
    def _holds(proof: Proof) -> bool:
        shrinks = proof.shrinkage > SHRINKS and proof.interval[0] > 0.0
        return shrinks and proof.outweighs > OUTWEIGHS

    @cached_property
    def sigma(self) -> float:
        """Standard deviation [m] per axis, at the tool point, of noise without a memory."""
        stretches = self.scene.stretches
        rest = np.where(self.judged[:, None], self.rest, np.nan)
        per_axis = [white_sigma(row, stretches) for row in rest.T]
        return float(np.sqrt(np.mean(np.square(per_axis))))

    def slow(self, values: FloatArray) -> float:
        """Return the root mean square [m] per axis of what in (n, 3) has a memory."""
        squares = []
        for row in np.where(self.judged[:, None], values, np.nan).T:
            white = white_sigma(row, self.scene.stretches) ** 2
            block = MEANS[0]
            found = means(row, self.scene.stretches, block)
            squares.append(max(0.0, float(np.mean(found**2)) - white / block) if len(found) else 0)
        return float(np.sqrt(np.mean(squares)))

    @cached_property
    def verdict(self) -> str:
        """``explained``, ``no_gap``, ``unexplained``, or ``undetermined`` where nothing is noise.

        An actual angle that is a copy of the command was not measured.
        """
        if self.sigma == 0.0 and not self.adopted:
            return "undetermined"
        if self.slow(self.rest) > NOISE_LIKE * self.sigma:
            return "unexplained"
        return "explained" if self.adopted else "no_gap"

    @cached_property
    def judged(self) -> BoolArray:
        """(n,) rows whose past is known: the others are drawn, but nothing rests on them."""
        known = self.scene.known
        return known if known.any() else np.ones_like(known)

    @cached_property
    def proofs(self) -> list[Proof]:
        """Of all effects that were tried, on rows that were not fitted."""
        proofs = []
        for effect in self.planned:
            block = _blocks(len(self.scene.time))
            after = effect.scale - effect.withheld
            proofs.append(_proof(effect.name, PROGRAM, effect.scale, after, block))
        for verdict in self.verdicts:
            proofs += self._proofs_of(verdict)
        return proofs

    def _proofs_of(self, verdict: Verdict) -> list[Proof]:
        stage = verdict.stage
        good = stage.scene.known
        left = stage.at_tool(_filled(stage, verdict)) * good[:, None]
        block = _blocks(len(left))
        found = []
        values = withheld(verdict) if verdict.adopted else {}
        rest = left - sum(values.values(), np.zeros_like(left)) * good[:, None]
        for name in verdict.adopted:
            after = left - values[name] * good[:, None]
            beside = _beside(stage, values[name], rest)
            found.append(_proof(name, stage.name, left, after, block, beside))
            left = after
        for name in verdict.with_each:
            more = withheld(verdict, name)
            change = sum(more.values()) - sum(values.values(), np.zeros_like(left))
            after = left - change * good[:, None]
            beside = _beside(stage, more[name], after)
            found.append(_proof(name, stage.name, left, after, block, beside))
        return found

    @cached_property
    def withheld_on(self) -> str:
        """On what the proofs rest, in words."""
        runs = len(np.unique(self.recording.run))
        return "runs not fitted" if runs >= WHOLE_RUNS else "stretches not fitted"

    @cached_property
    def contour_left(self) -> FloatArray:
        """(n,) [m] off the path less what a model file with the adopted effects takes off."""
        planned = {p.name for p in self.planned}
        kept = {n: v for n, v in self.explained.items() if n not in planned}
        places = (p.value for p in self.planned if p.is_place and p.name in self.explained)
        return self._off_path(kept, sum(places, np.zeros_like(self.gap)))

    @property
    def left_off_path(self) -> dict[str, Any]:
        """What a model file leaves off the path, as a table: with its interval, without noise."""
        off = (self.contour_left * self.judged)[:, None]
        share = _proof("", "", np.ones_like(off) * self.judged[:, None], off, _blocks(len(off)))
        noise = 2.0 * self.sigma**2
        ends = [1.0 - end for end in share.interval[::-1]]
        levels = [float(np.sqrt(max(0.0, v**2 - noise))) for v in (share.after, *ends)]
        rms, low, high = (float(np.round(v / MM, 6)) for v in levels)
        return {"contour_rms_mm": rms, "contour_rms_ci_mm": [low, high]}

    @cached_property
    def contour(self) -> FloatArray:
        """(n,) [m] distance of the tool point from the commanded path, whatever the clock."""
        return self._off_path({}, np.zeros_like(self.gap))

    def _off_path(self, explained: dict[str, FloatArray], planned: FloatArray) -> FloatArray:
        """Return how far (n,) [m] the tool point was off the path, less known and explained.

        Args:
            explained: (n, 3) by effect; what a model file does not give back stays.
            planned: (n, 3) [m] what is explained of the planner's doing.
        """
        gap = self.gap + sum(self._known.values(), np.zeros_like(self.gap))
        kept = [
            values
            for found in (self._known, explained)
            for name, values in found.items()
            if PATH_EFFECTS.get(name).is_kept
        ]
        gap = gap - self._as_stamped(sum(kept, np.zeros_like(gap)))
        if self.match is None:
            return contour_error(self.scene, self.scene.points + gap)
        # what the planner does is off the program, not off the command
        off = self.match.off
        from_command = contour_error(self.scene, self.scene.points + gap - off)
        return np.asarray(np.maximum(from_command, np.linalg.norm(off - planned, axis=1)))

    def _as_stamped(self, values: FloatArray) -> FloatArray:
        """Return values (n, 3) of the arm at the times that the clock of the tool point states."""
        late = sum(PATH_EFFECTS.get(name).late(theta) for name, theta in self.known.items())
        for verdict in self.verdicts:
            thetas = verdict.fitted.thetas
            names = (name for name in verdict.adopted if name in self.adopted)
            late += sum(PATH_EFFECTS.get(name).late(thetas[name]) for name in names)
        if not late:
            return values
        time, shifted = self.scene.time, np.empty_like(values)
        for rows in self.scene.stretches:
            at = time[rows] - late
            shifted[rows] = np.stack([np.interp(at, time[rows], v) for v in values[rows].T], axis=1)
        return shifted


def _filled(stage: Stage, verdict: Verdict) -> FloatArray:
    """Return the gap (m, n), where it was not measured as the named effects would have it."""
    good = np.isfinite(stage.gap)
    if good.all():
        return stage.gap
    values = values_of(stage, {name: verdict.fitted.thetas[name] for name in verdict.adopted})
    like = sum(values.values(), np.zeros_like(stage.gap))
    rest = np.where(good, stage.gap - like, 0.0).sum(axis=1) / np.maximum(good.sum(axis=1), 1)
    return np.where(good, stage.gap, like + rest[:, None])


def _blocks(n: int) -> AnyIntArray:
    """Return which stretch (n,) of the recording each row is drawn with."""
    return np.asarray(np.arange(n) * STRETCHES // max(1, n))


def _beside(stage: Stage, value: FloatArray, rest: FloatArray) -> float:
    """Return what a rest (n, 3) has [m] in the octaves in which an effect (n, 3) acts."""
    cycle, stretches = stage.scene.recording.cycle, stage.scene.stretches
    acts = octaves(value, stretches, cycle)
    share = acts / max(float(acts.max()), 1e-30)
    return float(np.sqrt(share @ octaves(rest, stretches, cycle)))


def _proof(
    name: str,
    stage: str,
    before: FloatArray,
    after: FloatArray,
    block: AnyIntArray,
    beside: float = 0.0,
) -> Proof:
    """Return the proof, with the interval of what other stretches would have shown."""
    count = int(block.max()) + 1
    sums = [
        np.bincount(block, np.sum(np.square(values), axis=1), count) for values in (before, after)
    ]
    rows = np.bincount(block, minlength=count)
    drawn = np.random.default_rng(_SEED).integers(0, count, (DRAWS, count))
    first, second = (s[drawn].sum(axis=1) for s in sums)
    shrunk = 1.0 - np.sqrt(second / np.maximum(first, 1e-30))
    low, high = np.quantile(shrunk, SURE)
    levels = [float(np.sqrt(s.sum() / rows.sum())) for s in sums]
    return Proof(name, stage, levels[0], levels[1], (float(low), float(high)), beside)
