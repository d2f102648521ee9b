"""What a campaign will leave, before anything of it is measured, and poses that leave little.

Before it, the numbers of an arm are open as the model of a diagnosis believes: what every arm has
more or less is there, another cause by its odds, each of a scale of its own
(``posterior.prior``). Readings close them but for a covariance that does not depend on what is
read; what that moves the tool by, at fresh poses and at those of a job, a model fitted to the
readings will miss.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.gap.data import Samples
from postproc.gap.effect import Kind
from postproc.gap.fit import testable
from postproc.gap.posterior import LOG_SCALES, Candidate, of_effect
from postproc.records import dataclass
from postproc.units import MM

_ARMS = 40
"""Arms drawn from what is believed: what they leave differs by a tenth, their mean by a few
hundredths."""
_SEED = 41


@dataclass(frozen=True, slots=True)
class Promise:
    """What is missed at fresh poses, readings' noise included, and at a job's, 3D rms [m]."""

    left: float
    job: float | None

    @property
    def words(self) -> str:
        """The promise in words."""
        at_job = "" if self.job is None else f", {self.job / MM:.3f} mm at the job"
        return f"leaves {self.left / MM:.3f} mm at fresh poses{at_job}"


@dataclass(frozen=True, slots=True)
class Open:
    """Numbers of arms that are open before a campaign.

    A: (n, 3, p) what numbers of unit prior move rows by, in noise; chance: (p,) with which each is
    there; arms: (a, p) how widely they are open in some arms, 0 where they are not there; sigma: of
    a reading per axis [m].
    """

    A: FloatArray
    chance: FloatArray
    arms: FloatArray
    sigma: float

    @classmethod
    def of(cls, samples: Samples, sigma: float) -> Open:
        """Return what is open at rows: those of plans, fresh ones and those of a job together."""
        effects, _ = testable(samples, {}, registered=True, several=False)
        # the tables of joints hold waves of any order
        candidates = [
            of_effect(e, samples, setting, key, e.kind is Kind.REGISTRATION)
            for e in effects
            if e.kind in (Kind.MACHINE, Kind.REGISTRATION) and not e.periodic
            for key, setting in e.variants(e.prepare(samples)).items()
        ]
        A = np.concatenate([c.X for c in candidates], axis=2) / sigma
        chance = np.concatenate([np.full(c.X.shape[2], _chance(c)) for c in candidates])
        rng = np.random.default_rng(_SEED)
        return cls(A, chance, np.stack([_arm(candidates, rng) for _ in range(_ARMS)]), sigma)

    def promise(self, rows: IndexArray, fresh: IndexArray, job: IndexArray) -> Promise:
        """Return what is left once rows are read, at fresh ones and at those of a job, if any."""
        p = self.A.shape[2]
        H, *goals = (
            part.T @ part for part in (self.A[some].reshape(-1, p) for some in (rows, fresh, job))
        )
        square = np.zeros((len(self.arms), 2))
        for arm, width in enumerate(self.arms):
            there = np.flatnonzero(width)
            scale = np.outer(width[there], width[there])
            own = np.ix_(there, there)
            covariance = scale * np.linalg.inv(scale * H[own] + np.eye(len(there)))
            square[arm] = [float(np.sum(covariance * goal[own])) for goal in goals]
        left = np.mean(np.sqrt(3.0 + square[:, 0] / len(fresh)))
        at_job = np.mean(np.sqrt(square[:, 1] / max(len(job), 1)))
        return Promise(self.sigma * float(left), self.sigma * float(at_job) if len(job) else None)

    def exchanged(
        self, plan: IndexArray, fixed: int, rows: IndexArray, job: IndexArray
    ) -> IndexArray:
        """Return postures by which a job is missed by less than by those of a plan.

        The one that tells least of the job gives way to the one that tells most, as long as that
        helps: the exchange of Fedorov (1972, Theory of Optimal Experiments) for what is predicted.

        Args:
            plan: (k,) numbers of the postures to start from.
            fixed: how many of the first stay.
            rows: (m, r) the rows of each posture that may be taken.
            job: rows of the job.
        """
        A, p = self.A * np.sqrt(self.chance), self.A.shape[2]
        own = A[rows].reshape(len(rows), -1, p)
        read_first = own[plan].reshape(-1, p)
        seen = own @ np.linalg.inv(read_first.T @ read_first + np.eye(p))
        goal = seen @ np.asarray(np.linalg.qr(A[job].reshape(-1, p), mode="r")).T
        one, chosen = np.eye(own.shape[1]), plan.copy()

        def told(sign: float) -> FloatArray:
            """Return by how much (m,) each posture lowers the square at the job, read once more."""
            S = one + sign * (seen @ np.swapaxes(own, 1, 2))
            return np.asarray(np.einsum("kij,kji->k", np.linalg.inv(S), goal @ goal.mT))

        def read(k: int, sign: float) -> None:
            """Read a posture once more, or once less."""
            step = sign * (seen @ own[k].T) @ np.linalg.inv(one + sign * (seen[k] @ own[k].T))
            goal[:], seen[:] = goal - step @ goal[k], seen - step @ seen[k]

        for _ in range(2 * len(plan)):
            lost = told(-1.0)[chosen[fixed:]]
            out = fixed + int(np.argmin(lost))
            read(chosen[out], -1.0)
            gain = told(1.0)
            gain[chosen] = -np.inf
            best = int(np.argmax(gain))
            if gain[best] <= lost[out - fixed]:
                break
            read(best, 1.0)
            chosen[out] = best
        return chosen


def _chance(candidate: Candidate) -> float:
    """Return how often an arm has what a candidate is."""
    if candidate.effect is None or candidate.fixed or candidate.effect.is_common:
        return 1.0
    return float(1.0 / (1.0 + np.exp(-candidate.odds)))


def _arm(candidates: Sequence[Candidate], rng: np.random.Generator) -> FloatArray:
    """Return how widely (p,) the numbers of an arm are open: half-Cauchy scales of those there."""
    widths = []
    for c in candidates:
        scale = np.clip(np.abs(rng.standard_cauchy(c.families)), *np.exp(LOG_SCALES[[0, -1]]))
        there = rng.random() < _chance(c)
        widths.append(np.ones(len(c.family)) if c.fixed else there * scale[c.family])
    return np.concatenate(widths)
