"""What to measure next: the poses and loads that tell apart what the rows do not."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.gap.dataset import Samples, make_samples
from postproc.gap.diagnose import Finding
from postproc.gap.linear import Block, Gram, block_of
from postproc.model.arrays import FloatArray
from postproc.units import DEG

_CANDIDATES = 300
_POSES = 10
_SEED = 17


def next_measurements(finding: Finding) -> list[dict[str, Any]]:
    """Return poses with the reason, the most telling first; empty if nothing is ambiguous."""
    pair = _pair(finding)
    if pair is not None:
        return _telling(finding, *pair)
    if finding.verdict == "unexplained":
        return _worst(finding)
    return []


def _pair(finding: Finding) -> tuple[str, str] | None:
    """Return the keys of the two blocks that are hardest to tell apart, None without any."""
    names = {b.key: b.name for b in finding.bench.blocks}
    for key in finding.choice.keys:
        for twin in finding.choice.evidence[key].twins:
            other = next((k for k, n in names.items() if n == twin), None)
            if other is not None:
                return key, other
    return None


def _telling(finding: Finding, key: str, other: str) -> list[dict[str, Any]]:
    """Choose greedily where the two explanations, each fitted to all rows, differ most."""
    bench = finding.bench
    blocks = {b.key: b for b in bench.blocks}
    rest = [k for k in (*bench.always, *finding.choice.keys) if k != key]
    gram = Gram.of(bench.blocks, bench.y, bench.weight)
    one, two = (*rest, key), (*rest, other)
    pool = _candidates(finding)
    far = {k: _far(blocks[k], pool) for k in {*one, *two}}
    theta = gram.solve(one)[0]
    truth = np.concatenate([far[k] for k in one], axis=2) @ theta
    X = np.concatenate([far[k] for k in two], axis=2)
    i = gram.index(two)
    H = gram.G[np.ix_(i, i)] + np.eye(len(i))
    seen = gram.G[np.ix_(i, gram.index(one))] @ theta
    chosen: list[int] = []
    total = 0.0
    for _ in range(_POSES):
        miss = truth - X @ np.linalg.solve(H, seen)
        size = np.linalg.norm(miss, axis=1)
        size[chosen] = 0.0
        best = int(np.argmax(size))
        chosen.append(best)
        total += float(size[best] / finding.noise) ** 2
        A = X[best] / finding.noise
        H = H + A.T @ A
        seen = seen + A.T @ (truth[best] / finding.noise)
    what = f"tells {blocks[key].name} from {blocks[other].name}"
    sigmas = round(float(np.sqrt(total)), 1)
    return [_row(pool, row, what, sigmas) for row in chosen]


def _worst(finding: Finding) -> list[dict[str, Any]]:
    """Return the poses with the largest unexplained rest, one a cluster, to be measured again."""
    size = np.linalg.norm(finding.residual, axis=1) * finding.kept
    order = np.argsort(-size, kind="stable")
    seen: set[int] = set()
    found = []
    clearest = finding.tests[0].name if finding.tests else "the pose"
    for row in order:
        cluster = int(finding.problem.split.cluster[row])
        if cluster not in seen:
            seen.add(cluster)
            q = np.round(finding.problem.samples.q[row] / DEG, 4).tolist()
            why = f"largest unexplained rest; measure again and vary only {clearest}"
            found.append({"q_deg": q, "why": why})
        if len(found) == _POSES:
            break
    return found


def _far(block: Block, pool: Samples) -> FloatArray:
    effect = block.effect
    ratio = block.typical / np.array(
        [p.typical for p in effect.parameters(pool.arm, block.setting)]
    )
    return np.asarray(block_of(effect, pool, block.setting).X * ratio)


def _candidates(finding: Finding) -> Samples:
    """Return poses within the measured joint ranges widened by a third, loads and sides drawn."""
    samples = finding.problem.samples
    kin = samples.arm.kinematics
    rng = np.random.default_rng(_SEED)
    low, high = samples.q.min(axis=0), samples.q.max(axis=0)
    wide = 0.33 * (high - low) + 10.0 * DEG
    low, high = np.maximum(low - wide, kin.q_min), np.minimum(high + wide, kin.q_max)
    q = rng.uniform(low, high, (_CANDIDATES, 6))
    drawn: dict[str, Any] = {}
    for name in ("direction", "qd", "wrench", "temperature", "time"):
        if samples.has(name):
            values = samples.column(name)
            drawn[name] = values[rng.integers(0, len(values), _CANDIDATES)]
    return make_samples(samples.arm, q, **drawn)


def _row(pool: Samples, row: int, why: str, sigmas: float) -> dict[str, Any]:
    found: dict[str, Any] = {"q_deg": np.round(pool.q[row] / DEG, 4).tolist(), "why": why}
    if pool.wrench is not None:
        found["force_N"] = np.round(pool.wrench[row, :3], 1).tolist()
    if pool.direction is not None:
        found["approach"] = pool.direction[row].astype(int).tolist()
    found["separation_sigma"] = sigmas
    return found
