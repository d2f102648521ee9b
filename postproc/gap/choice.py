"""From evidence to names: which effects are adopted, which only resemble, which are twins.

Evidence alone is too generous: no model of a real robot is exact, and what a large effect's
formula leaves over is seen by hundreds of rows. So a name must also be large enough to matter,
win on rows that were not fitted, beat its own placebo, and not be the neighbour of a cause that
is outside of the library and explains the rows better.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.gap.dataset import Rows, Samples
from postproc.gap.linear import Block, Gram, block_of
from postproc.gap.select import Search, Subset, search
from postproc.gap.waves import Context
from postproc.model.arrays import FloatArray, IntArray

SMALLEST = 0.5
"""Unique part of a named effect, 3D root mean square, in sigma of one axis."""
SMALLEST_SHARE = 0.05
"""The same against the largest effect: below it, a flaw of the largest one's formula."""
SUSPECT_SHARE = 0.2
"""Unique part of a suspect against a neighbour's, from which it takes the name away."""
CLEAR = 6.0
"""Nats by which a model must beat the best one without the effect (odds 400 to 1)."""
COMPANIONS: Mapping[str, tuple[str, ...]] = {"gravity_sag": ("link_geometry",)}
"""Effects that another absorbs almost wholly on the rows it is fitted to, but not on others: how
little only they explain says nothing of their size. A free geometry imitates the sag of the arm
where it was measured and is wrong elsewhere."""
COMPANION_GAIN = 20.0
"""Nats that such an effect must bring."""
_PLACEBOS = 60
_PLACEBO_LIMIT = 0.02
NEIGHBOURS: Mapping[str, tuple[str, ...]] = {
    "friction_windup": ("backlash",),
    "nonlinear_stiffness": ("joint_compliance", "variable_stiffness"),
    "link_bending": ("joint_compliance", "variable_stiffness"),
    "tool_bending": ("joint_compliance", "variable_stiffness"),
    "leaning_base": ("gravity_sag", "payload_error", "counterbalance", "joint_compliance"),
    "link_sag": ("gravity_sag", "payload_error", "counterbalance", "joint_offset"),
    "tracker_creep": ("thermal_drift", "link_geometry"),
}
"""What a cause outside of the library is mistaken for."""


@dataclass(slots=True)
class Evidence:
    """What speaks for one effect in the chosen model.

    gain: nats lost without it, best replacement allowed; unique: [m] 3D rms that only it
    explains; wins: share of folds that it makes better; placebo: share of placebos as good.
    """

    gain: float
    unique: float
    wins: float = 1.0
    placebo: float = 0.0
    twins: tuple[str, ...] = ()
    reason: str = ""


@dataclass(slots=True)
class Choice:
    """Names and evidence. ``keys``: blocks of the library; ``suspects``: blocks outside of it."""

    keys: Subset
    suspects: Subset
    evidence: dict[str, Evidence]
    probability: dict[str, float]
    refused: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Bench:
    """Everything a choice is made on: rows, gap (n, 3) [m], weights, folds, blocks.

    ``barred``: effects that made sealed rows worse; their blocks are gone.
    """

    samples: Samples
    y: FloatArray
    weight: FloatArray
    fold: IntArray
    blocks: tuple[Block, ...]
    always: Subset
    barred: tuple[str, ...] = ()

    def without(self, names: Collection[str]) -> Bench:
        """Return the same rows with some effects barred for good."""
        blocks = tuple(b for b in self.blocks if b.name not in names)
        return replace(self, blocks=blocks, barred=(*self.barred, *sorted(names)))

    @property
    def sigma(self) -> float:
        """Noise [m] per axis."""
        return float(1.0 / np.max(self.weight))

    @property
    def rows(self) -> int:
        """Rows in use."""
        return int(np.count_nonzero(self.weight))


def choose(bench: Bench) -> Choice:
    """Return the names that the rows support."""
    gram = Gram.of(bench.blocks, bench.y, bench.weight)
    folds = _fold_grams(bench)
    barred: set[str] = set()
    refused: dict[str, str] = {}
    for _ in range(12):
        found = search(gram, bench.always, barred=barred)
        evidence = {k: _evidence(bench, found, folds, k) for k in found.best}
        weak = (
            _unphysical(bench, found)
            or _weakest(bench, found.best, evidence)
            or _imitated(bench, found.best, evidence)
        )
        if weak is None:
            break
        key, reason = weak
        refused[found.names[key]] = reason
        barred.add(key)
    found, evidence = _readmitted(bench, found, folds, evidence, barred, refused)
    suspects = tuple(k for k in found.best if _block(bench, k).suspect)
    keys = tuple(k for k in found.best if k not in suspects)
    keys = _shadowed(bench, keys, suspects, evidence, refused)
    for key in (*keys, *suspects):
        evidence[key].twins = _twins(bench, found, key, barred)
    keys, suspects = _doubtful(bench, keys, suspects, evidence, refused)
    keys = tuple(sorted(keys, key=lambda k: -evidence[k].unique))
    return Choice(keys, suspects, evidence, found.inclusion(), refused)


def _block(bench: Bench, key: str) -> Block:
    return next(block for block in bench.blocks if block.key == key)


def _fold_grams(bench: Bench) -> list[Gram]:
    grams = []
    for k in range(int(bench.fold.max()) + 1):
        rows = np.flatnonzero((bench.fold == k) & (bench.weight > 0))
        if len(rows) >= 3:
            part = [_picked(block, rows) for block in bench.blocks]
            grams.append(Gram.of(part, bench.y[rows], bench.weight[rows]))
    return grams


def _picked(block: Block, rows: Rows) -> Block:
    return replace(block, X=block.X[rows])


def _evidence(bench: Bench, found: Search, folds: Sequence[Gram], key: str) -> Evidence:
    best = found.best
    rest = tuple(k for k in best if k != key)
    with_it, without = (*found.always, *best), (*found.always, *rest)
    gain = found.score(best) - found.score(rest)
    more = found.gram.freedom(with_it) - found.gram.freedom(without)
    drop = found.gram.left(without) - found.gram.left(with_it) - more
    unique = bench.sigma * float(np.sqrt(max(drop, 0.0) / bench.rows))
    better = []
    for part in folds:
        others = found.gram.minus(part)
        a = part.misfit(with_it, others.solve(with_it)[0])
        b = part.misfit(without, others.solve(without)[0])
        better.append(b - a)
    wins = float(np.mean(np.array(better) > 0.0)) if better else 1.0
    if better and float(np.sum(better)) <= 0.0:
        wins = 0.0
    return Evidence(gain, unique, wins)


def _weakest(
    bench: Bench, best: Subset, evidence: Mapping[str, Evidence]
) -> tuple[str, str] | None:
    """Return the block that least deserves its place and why, None if all do."""
    if not best:
        return None
    largest = max(evidence[k].unique for k in best)
    bar = max(SMALLEST * bench.sigma, SMALLEST_SHARE * largest)
    failing = []
    for key in best:
        item = evidence[key]
        if item.gain > COMPANION_GAIN and is_companion(bench, best, key):
            continue
        if item.unique < bar:
            failing.append((item.unique / bar, key, "too small to tell from noise"))
        elif item.gain < CLEAR:
            failing.append((item.gain / CLEAR, key, "not clear enough"))
        elif item.wins < (0.85 if _block(bench, key).suspect else 0.7):
            failing.append((item.wins, key, "does not help on rows that were not fitted"))
    return min(failing)[1:] if failing else None


def _readmitted(
    bench: Bench,
    found: Search,
    folds: Sequence[Gram],
    evidence: dict[str, Evidence],
    barred: set[str],
    refused: dict[str, str],
) -> tuple[Search, dict[str, Evidence]]:
    """Give blocks that were put aside beside worse company a second chance, one at a time."""
    names = {b.key: b.name for b in bench.blocks}
    for key in sorted(barred):
        if refused.get(names[key], "").startswith("not physical"):
            continue
        again = search(
            found.gram, bench.always, 0, set(names) - {*found.best, key} - set(bench.always)
        )
        subset = (*found.best, key)
        if not again.legal(subset) or again.score(subset) < found.score(found.best) + CLEAR:
            continue
        again.scores |= {k: v for k, v in found.scores.items() if set(k) <= set(subset)}
        if again.best != tuple(sorted(subset)):
            continue
        more = {k: _evidence(bench, again, folds, k) for k in subset}
        if _weakest(bench, again.best, more) is None and not _unphysical(bench, again):
            again.names |= found.names
            again.price |= found.price
            again.scores |= found.scores
            found, evidence = again, more
            barred.discard(key)
            refused.pop(names[key], None)
    return found, evidence


def is_companion(bench: Bench, best: Subset, key: str) -> bool:
    """Return whether an effect is nearly absorbed by another one that is in the subset."""
    hosts = COMPANIONS.get(_block(bench, key).name, ())
    return any(_block(bench, k).name in hosts for k in best)


def _unphysical(bench: Bench, found: Search) -> tuple[str, str] | None:
    """Return a block whose fitted numbers are not physical, and why."""
    keys = (*found.always, *found.best)
    theta, covariance = found.gram.solve(keys)
    deviation = np.sqrt(np.diag(covariance))
    start = 0
    for key in keys:
        block = _block(bench, key)
        part = slice(start, start + block.X.shape[2])
        start = part.stop
        if key in found.best:
            arm = bench.samples.arm
            size = block.typical
            total = theta[part] * size
            if block.start is not None:
                total = total + np.nan_to_num(block.start)
            reason = block.effect.objection(total, deviation[part] * size, arm)
            if reason:
                return key, f"not physical: {reason}"
    return None


def _shadowed(
    bench: Bench,
    keys: Subset,
    suspects: Subset,
    evidence: Mapping[str, Evidence],
    refused: dict[str, str],
) -> Subset:
    """Return the keys without those that a suspect takes the name from."""
    kept = []
    for key in keys:
        name = _block(bench, key).name
        rivals = [
            s
            for s in suspects
            if name in NEIGHBOURS.get(s, ())
            and evidence[s].unique > SUSPECT_SHARE * evidence[key].unique
        ]
        if rivals:
            refused[name] = f"the rows follow {rivals[0]} more closely than this effect"
        else:
            kept.append(key)
    return tuple(kept)


def _imitated(
    bench: Bench, best: Subset, evidence: Mapping[str, Evidence]
) -> tuple[str, str] | None:
    """Return a block that a placebo of its own can imitate, and why it goes."""
    for key in best:
        if not _block(bench, key).suspect:
            evidence[key].placebo = _placebo(bench, best, key)
            if evidence[key].placebo > _PLACEBO_LIMIT:
                return key, "a placebo does as well"
    return None


def _doubtful(
    bench: Bench,
    keys: Subset,
    suspects: Subset,
    evidence: dict[str, Evidence],
    refused: dict[str, str],
) -> tuple[Subset, Subset]:
    """Take the name from an effect that a cause outside of the library would replace as well.

    Where another effect of the library would do so too, the name stands, in that set.
    """
    kept, called = [], list(suspects)
    for key in keys:
        name = _block(bench, key).name
        twins = evidence[key].twins
        rivals = [s for s in twins if name in NEIGHBOURS.get(s, ())]
        if rivals and all(twin in NEIGHBOURS for twin in twins):
            refused[name] = f"the rows cannot tell it from {rivals[0]}, which is not a known cause"
            for rival in rivals:
                if rival not in called:
                    called.append(rival)
                    evidence[rival] = replace(evidence[key])
        else:
            kept.append(key)
    return tuple(kept), tuple(called)


def _placebo(bench: Bench, best: Subset, key: str) -> float:
    """Return the share of shuffled copies of an effect that explain as much as it does."""
    block = _block(bench, key)
    if not block.effect.needs:
        return 0.0
    rest = {*bench.always, *(k for k in best if k != key)}
    use = np.flatnonzero(bench.weight > 0)
    weight = bench.weight[use]
    context = Context(
        [_picked(b, use) for b in bench.blocks if b.key in rest], bench.y[use], weight
    )
    left = context.clean(context.y[:, None])[:, 0]
    samples = bench.samples.rows(use)
    rng = np.random.default_rng(11)
    real = _brought(context, left, block.X[use], weight)
    beaten = 0
    for _ in range(_PLACEBOS):
        fake = block.effect.placebo(samples, rng)
        mixed = block_of(block.effect, fake, block.setting).X
        beaten += _brought(context, left, mixed, weight) >= real
        if beaten > 1:
            break
    return beaten / _PLACEBOS


def _brought(context: Context, left: FloatArray, X: FloatArray, weight: FloatArray) -> float:
    """Return the evidence [nats] that columns (n, 3, p) add to a context."""
    Z = (X * weight[:, None, None]).reshape(-1, X.shape[2])
    A = Z.T @ context.clean(Z) + np.eye(Z.shape[1])
    b = Z.T @ left
    return float(0.5 * b @ np.linalg.solve(A, b) - 0.5 * np.linalg.slogdet(A)[1])


def _twins(bench: Bench, found: Search, key: str, barred: set[str]) -> tuple[str, ...]:
    """Return the effects that would do as well in place of one: the set it belongs to."""
    name = found.names[key]
    chosen = {found.names[k] for k in found.best}
    rest = tuple(k for k in found.best if k != key)
    others = [b.key for b in bench.blocks if b.key in found.names and b.name not in chosen - {name}]
    others = [k for k in others if found.names[k] != name and k not in barred]
    here = found.score(found.best)
    twins: set[str] = set()
    for size in (1, 2):
        for more in itertools.combinations(others, size):
            subset = (*rest, *more)
            if not found.legal(subset) or here - found.score(subset) >= CLEAR:
                continue
            if size == 1:
                twins.add(found.names[more[0]])
            elif not twins & {found.names[k] for k in more}:
                twins |= {found.names[k] for k in more}
    return tuple(sorted(twins))
