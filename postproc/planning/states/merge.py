"""States of more tags, and of tags on a finer grid of spins, joined with those known."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, taken
from postproc.planning.states.candidates import States, sample
from postproc.planning.states.problem import Problem
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Merged:
    """States of the tags of two sets together.

    Args:
        states: of all tags, rising.
        tags: (n,) them; is_new: (n,) those whose states are new.
        source: (N,) the state before, -1 for a new one.
    """

    states: States
    tags: IndexArray
    is_new: BoolArray
    source: IndexArray


def sample_on(problem: Problem, tags: IndexArray, spins: FloatArray, stride: IndexArray) -> States:
    """Return the states of tags (n,), each on every ``stride``-th (n,) spin of the finest grid.

    Args:
        problem: what is asked.
        tags: (n,) rising.
        spins: (S,) or (n, S) [rad], the finest grid.
        stride: (n,).
    """
    width = spins.shape[-1]
    result: Merged | None = None
    for step in np.unique(stride)[::-1].tolist():
        rows = np.flatnonzero(stride == step)
        part = spins[::step] if spins.ndim == 1 else spins[rows][:, ::step]
        states = sample(problem, tags[rows], part, tilts=problem.tilts)
        fine = np.arange(len(states.tilts))[:, None] * width + step * np.arange(part.shape[-1])
        states.column = fine.ravel().astype(np.int16)[states.column]
        states.spins = spins if spins.ndim == 1 else spins[rows]
        if result is None:
            result = Merged(states, tags[rows], np.ones(len(rows), np.bool_), np.zeros(0, int))
        else:
            result = merged(result.states, result.tags, states, tags[rows])
    if result is None:
        return sample(problem, tags, spins, tilts=problem.tilts)
    return result.states


def merged(known: States, tags: IndexArray, new: States, new_tags: IndexArray) -> Merged:
    """Return the states of ``tags`` (n,) and ``new_tags`` (m,), of both lists the new ones."""
    kept = np.flatnonzero(~np.isin(tags, new_tags))
    both = np.concatenate([tags[kept], new_tags])
    order = np.argsort(both, kind="stable")
    is_new = (np.arange(len(both)) >= len(kept))[order]
    starts = np.concatenate([known.offsets[kept], new.offsets[:-1] + len(known.q)])[order]
    counts = np.concatenate([np.diff(known.offsets)[kept], np.diff(new.offsets)])[order]
    offsets = np.concatenate([[0], np.cumsum(counts)])
    pick = np.repeat(starts - offsets[:-1], counts) + np.arange(offsets[-1])
    first = int(known.config[-1]) + 1 if len(known.config) else 0
    config = np.concatenate([known.config, new.config + first])[pick]
    edges = np.flatnonzero(np.diff(config)) + 1
    ranks = np.zeros(len(config), dtype=np.int32)
    ranks[edges] = 1
    spins = known.spins
    if spins.ndim == 2:
        spins = np.concatenate([known.spins[kept], new.spins])[order]
    states = States(
        offsets=offsets,
        q=taken(np.concatenate([known.q, new.q]), pick),
        column=np.concatenate([known.column, new.column])[pick],
        branch=np.concatenate([known.branch, new.branch])[pick],
        config=np.cumsum(ranks, dtype=np.int32),
        cost=np.concatenate([known.cost, new.cost])[pick],
        index=np.concatenate([known.index, new.index])[pick],
        spins=spins,
        tilts=known.tilts,
        refused=np.concatenate([known.refused[kept], new.refused])[order],
        tried=np.concatenate([known.tried[kept], new.tried])[order],
    )
    source = np.where(pick < len(known.q), pick, -1)
    return Merged(states, both[order], is_new, source)
