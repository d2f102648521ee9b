"""Programs of random motions: ``verify`` and the planner's checks against brute force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.collision import Scene
from postproc.errors import Finding, RunKind
from postproc.geometry import abc_from_rotation, rotation_from_vector, transform
from postproc.jobs.verify import verify
from postproc.kinematics import Kinematics, bound_of
from postproc.paths import Paths
from postproc.planning.checks import MORE_CLEARANCE, RESOLUTION
from postproc.planning.route.corners import COARSE
from postproc.units import DEG, MM
from postproc.verification.corners import blended, corners_of
from tools.bench.outside import Machine, Move, Way, moves_of, ways_of
from tools.bench.score import Place, Score, corner_of, kind_of
from tools.bench.solids import Judge

VARIANTS = 12
"""Random ways at each corner."""
NEAR = 0.5 * MM
"""What comes so near [m] beyond the clearance is rightly refused."""


def random_program(rng: np.random.Generator, machine: Machine, free: FloatArray, count: int) -> str:
    """Return the text of random motions between free configurations (f, 6 + k)."""
    lines = ["DEF rnd( )", "BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,1)"]
    lines += ["$IPO_MODE=#BASE", "$ORI_TYPE=#VAR", "$CIRC_TYPE=#BASE", "$ADVANCE=3"]
    lines += ["$VEL.ORI1=200.0", "$VEL.ORI2=200.0", "$APO.CORI=5.0", "$APO.CPTP=100"]
    lines += ["BAS(#VEL_PTP,10)", "$VEL.CP=0.05"]
    q = free[rng.integers(len(free))]
    lines.append(_joints(q))
    for _ in range(count):
        other = free[rng.integers(len(free))]
        blend = " C_DIS" if rng.uniform() < 0.8 else ""
        most = machine.cell.motion.approximation / MM
        lines.append(f"$APO.CDIS={0.999 * np.exp(rng.uniform(np.log(0.5), np.log(most))):.4f}")
        if rng.uniform() < 0.4:
            q = q + rng.uniform(0.05, 0.4) * (other - q)
            lines.append(_joints(q) + blend)
        elif (step := _line(rng, machine, q, other)) is not None:
            q, text = step
            lines.append(text + blend)
    return "\r\n".join([*lines, "END", ""])


def _line(
    rng: np.random.Generator, machine: Machine, q: FloatArray, other: FloatArray
) -> tuple[FloatArray, str] | None:
    """Return where a random straight motion leads to and its text, None if the arm cannot."""
    way = rng.normal(size=3)
    size = np.exp(rng.uniform(np.log(2e-3), np.log(0.6)))
    turn = rng.uniform(-0.3, 0.3, 3) * min(1.0, size / 0.2)
    T = machine.tcp(q[None])[0]
    target = transform(
        T[:3, :3] @ rotation_from_vector(turn), T[:3, 3] + size * way / np.linalg.norm(way)
    )
    external = q[6:] + (other[6:] - q[6:]) * rng.uniform(0.0, 0.3) * (rng.uniform() < 0.3)
    flange = machine.T_robroot_base(external[None]) @ target @ np.linalg.inv(machine.tool)
    found, valid = machine.arm.ik_in(flange, np.array([int(machine.arm.slot(q[:6]))]))
    found = found[0] + 2.0 * np.pi * np.round((q[:6] - found[0]) / (2.0 * np.pi))
    if not valid[0] or np.abs(found - q[:6]).max() > 40.0 * DEG:
        return None
    return np.concatenate([found, external]), _pose(target, external)


def _joints(q: FloatArray) -> str:
    parts = [f"A{i + 1} {value / DEG:.5f}" for i, value in enumerate(q[:6])]
    return "PTP {" + ",".join([*parts, *_externals(q[6:])]) + "}"


def _pose(T: FloatArray, external: FloatArray) -> str:
    names, values = "XYZABC", [*(T[:3, 3] / MM), *(abc_from_rotation(T[:3, :3]) / DEG)]
    parts = [f"{name} {value:.5f}" for name, value in zip(names, values, strict=True)]
    return "LIN {" + ",".join([*parts, *_externals(external)]) + "}"


def _externals(external: FloatArray) -> list[str]:
    return [f"E{i + 1} {value / MM:.5f}" for i, value in enumerate(external)]


def judge_programs(
    place: Place, folder: Path, rng: np.random.Generator, count: int, score: Score
) -> None:
    """Judge programs of random motions by ``verify``, as the planner does, and by execution."""
    cell, machine = place.cell, place.machine
    scene = Scene.build(cell, machine.arm)
    wider = Judge(cell, machine.arm, cell.limits.clearance + NEAR)
    low, high = (
        np.array([-1.2, -2.2, 0.2, -2.5, -1.8, -3.0]),
        np.array([1.2, -0.4, 2.4, 2.5, 1.8, 3.0]),
    )
    q = rng.uniform(low, high, (4000, 6))
    q = np.hstack([q, rng.uniform(-1.5, 1.5, (len(q), len(cell.external_axes)))])
    q = q[np.abs(q[:, 4]) > 0.2]
    free = q[~scene.kept(3e-3).check(q).hit]
    if len(free) < 20:
        return
    for _ in range(count):
        text = random_program(rng, machine, free, 14)
        path = folder / "rnd.src"
        path.write_bytes(text.encode("ascii"))
        report = verify(path, cell)
        moves = moves_of(text, len(cell.external_axes))
        ways = ways_of(machine, moves, rng, 1.0, VARIANTS)
        for way in ways:
            way.touch = np.full(len(way.q), way.at_feed)
        by_verify = {key for finding in report.violations for key in _refused(finding)}
        verdicts = {"verify": by_verify}
        if report.run is not None:
            refused = planner_refuses(scene, machine.arm, report.run.paths)
            verdicts["planner"] = {(moves[number].line, what) for number, what in refused}
        _compare(verdicts, moves, ways, (place.judge, wider), folder.name, score)


def planner_refuses(scene: Scene, arm: Kinematics, paths: Paths) -> set[tuple[int, str]]:
    """Return the motions and corners that the planner would refuse."""
    near = scene.kept(MORE_CLEARANCE)
    motion, share, q = paths.in_order()[:3]
    q = np.hstack([q, paths.curves.external_at(motion, share, paths.external)])
    known = np.isfinite(q).all(axis=1)
    motion, q = motion[known], q[known]
    touch = paths.trace.is_cp
    hits = near.check_paths(q[:-1], q[1:], touch[motion[1:]], RESOLUTION, track=motion[1:])
    found = {(number, "motion") for number in motion[1:][hits.hit].tolist()}
    at = blended(paths)
    if len(at):
        bound = bound_of(arm, corners_of(paths, arm, at))
        met = near.check_corners(bound, touch[at] & touch[at + 1], RESOLUTION, COARSE)
        found |= {(number, "corner") for number in at[met.hit | bound.lost].tolist()}
    return found


def _compare(
    verdicts: Mapping[str, set[tuple[int, str]]],
    moves: list[Move],
    ways: list[Way],
    judges: tuple[Judge, Judge],
    where: str,
    score: Score,
) -> None:
    """Compare verdicts, motion by motion and corner by corner: lines and what they refuse there.

    A refusal is false where nothing comes nearer than ``NEAR`` beyond the clearance.
    """
    refused = verdicts["verify"]
    unknown = min((line for line, what in refused if not what), default=10**9)
    keys: dict[tuple[int, str], list[Way]] = {}
    for way in ways:
        if way.what == "lost" or moves[way.move].line >= unknown:
            break
        keys.setdefault((moves[way.move].line, way.what), []).append(way)
    lines = [move.line for move in moves]
    wrong = {line for line, what in refused if what == "other"}
    kinds = [kind_of(moves, number) for number in range(len(moves))]
    for key, group in keys.items():
        behind = lines[min(lines.index(key[0]) + 1, len(lines) - 1)]
        if key[0] in wrong or (key[1] == "corner" and behind in wrong):
            score.counts["refused for other reasons"] += 1
            continue
        number = group[0].move
        what = kinds[number] if key[1] == "motion" else corner_of(kinds, number)
        hit, near = (
            next((h for h in (judge.met(w.q, w.touch) for w in group) if h), "") for judge in judges
        )
        score.counts[f"{what}: {'hit' if hit else 'near' if near else 'free'}"] += 1
        for name, verdict in verdicts.items():
            if key in verdict and not near:
                score.counts[f"{what}: {name}"] += 1
                score.false.append(f"{name} refuses a {what}: {where} line {key[0]}")
            elif hit and key not in verdict:
                score.counts[f"{what}: missed"] += 1
                score.note(f"MISSED by {name} in a random {what}", f"{where} {key[0]}: {hit}")


def _refused(finding: Finding) -> Iterator[tuple[int, str]]:
    """Yield line and part of the program that a finding refuses, no part: it cannot be run."""
    line = 0 if finding.source is None else finding.source.line
    at_corner = "corner" in finding.message
    if finding.code in (RunKind.UNREACHABLE, RunKind.TURN):
        yield line, ""
    elif finding.code == RunKind.CORNER and "straight wrist" in finding.message:
        yield line, "other"
    elif finding.code == RunKind.CORNER or (finding.code == RunKind.COLLISION and at_corner):
        yield line, "corner"
    elif finding.code == RunKind.COLLISION:
        yield line, "motion"
    else:
        yield line, "other"
