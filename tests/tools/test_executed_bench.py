"""A small slice of the bench that executes texts from outside, and that it can fail."""

from collections import Counter

import numpy as np
import pytest

from postproc.cell import parse_cell
from postproc.collision import Scene
from postproc.geometry import abc_from_rotation
from postproc.kinematics import build
from postproc.units import DEG, MM
from tests.cells import cell_text
from tools.bench import executed
from tools.bench.executed import judged
from tools.bench.outside import Machine, Way, allowed, moves_of, ways_of
from tools.bench.score import Score
from tools.bench.solids import Judge

MESHES = (
    "meshes = [{ box = { size_mm = [100, 100, 300] }, xyz_mm = [0, 0, 200] }]\n"
    "cutter = { diameter_mm = 8, length_mm = 40 }\n"
)
ROD = """
[[obstacles]]
name = "rod"
cylinder = { radius_mm = 1, length_mm = 400 }
xyz_mm = [2090, 0, 1100]
abc_deg = [90, 90, 0]
"""


def test_nothing_is_missed_and_both_commands_agree():
    score = judged(1, tags=10, seed=7, programs=2)
    assert score.wrong == []
    assert score.counts["moves"] > 10
    for what in ("motion", "corner"):
        for verdict in ("hit", "free", "converted"):
            names = [name.replace(", rail", "") for name, n in score.counts.items() if n]
            assert any(f"{what}: {verdict}" in name for name in names)


def test_a_log_is_gone_on_from(tmp_path, monkeypatch, capsys):
    asked = []

    def judged(number, *_):
        asked.append(number)
        counts = Counter({"path motion: converted": 10, "path motion: free": 4})
        return Score(counts + Counter({"path motion: verify": number}), [f"wrong {number}"])

    monkeypatch.setattr(executed, "judged", judged)
    for cells in ("2", "3"):
        words = ["executed", "--cells", cells, "--log", str(tmp_path / "log")]
        monkeypatch.setattr("sys.argv", words)
        executed.main()
    assert asked == [0, 1, 2]
    out = capsys.readouterr().out
    assert "| path motion | 30 | 0 | 12 | 3 (25.0%) | 0 (0.0%) |" in out
    assert out.endswith("  wrong 0\n  wrong 1\n  wrong 2\n")


@pytest.fixture(scope="module")
def shop():
    cell = parse_cell(cell_text(ROD, tool=MESHES).encode(), "cell.toml")
    return cell, build(cell.robot)


def abc(T):
    return abc_from_rotation(T[:3, :3])


def test_the_text_is_read_and_run_as_the_controller_does(shop):
    cell, arm = shop
    machine = Machine(cell, arm)
    start = np.array([0, -80, 100, 0, 50, 0]) * DEG
    T = machine.tcp(start[None])[0]
    X, Y, Z = T[:3, 3] / MM
    turn = ",".join(f"{name} {v:.6f}" for name, v in zip("ABC", abc(T) / DEG, strict=True))
    text = (
        "PTP {A1 0,A2 -80,A3 100,A4 0,A5 50,A6 0}\r\n$APO.CDIS=30\r\n$VEL.CP=0.5\r\n"
        f"LIN {{X {X - 100},Y {Y},Z {Z},{turn}}} C_DIS\r\n"
        f"LIN {{X {X - 100},Y {Y + 200},Z {Z},{turn}}}\r\n"
        f"CIRC {{X {X - 100},Y {Y + 300},Z {Z + 100}}},{{X {X - 100},Y {Y + 400},Z {Z},{turn}}}\r\n"
    )
    moves = moves_of(text, 0)
    assert [move.word for move in moves] == ["PTP", "LIN", "LIN", "CIRC"]
    assert [move.cdis for move in moves] == [0.0, 0.03, 0.0, 0.0]
    ways = list(ways_of(machine, moves, np.random.default_rng(1), 0.0, 5))
    assert [way.what for way in ways] == ["motion", *5 * ["corner"], "motion", "motion"]
    arc = ways[-1].T[:, :3, 3]
    assert np.allclose(np.linalg.norm(arc - T[:3, 3] - [-0.1, 0.3, 0.0], axis=1), 0.1, atol=1e-6)
    assert np.linalg.norm(np.diff(arc, axis=0), axis=1).max() < 1.01e-3
    for way in ways[1:6]:
        off = np.linalg.norm(way.T[:, :3, 3] - T[:3, 3] - [-0.1, 0.0, 0.0], axis=1)
        assert off.max() < 0.03 + 1e-3
        assert (way.T[:, 1, 3] > T[1, 3] - 1e-6).all()


def test_a_thin_rod_between_two_poses_is_found(shop):
    cell, arm = shop
    near = Judge(cell, arm, 0.0)
    a, b = (np.array([side, -80, 90, 0, 20, 0]) * np.pi / 180.0 for side in (-30, 30))
    way = a + np.linspace(0.0, 1.0, 3000)[:, None] * (b - a)
    free = Scene.build(cell, arm).check(way).hit
    found = near.met(way, np.zeros(len(way), dtype=bool))
    assert bool(found) == bool(free.any())
    assert not near.met(way[:1], np.zeros(1, dtype=bool))


def test_a_cutter_may_leave_only_what_it_has_cut():
    T = np.repeat(np.eye(4)[None], 4, axis=0)
    T[:, 2, 3] = [0.0, 0.01, 0.02, 0.03]
    aside = T.copy()
    aside[:, 0, 3] = [0.0, 0.001, 0.001, 0.001]
    cut = Way(1, "motion", np.zeros((1, 6)), T[:1], True)
    out, beside = (Way(2, "motion", np.zeros((4, 6)), way, False) for way in (T, aside))
    allowed([cut, out, beside], np.array([0.0, 0.0, -1.0]))
    assert cut.touch.all()
    assert out.touch.all()
    assert beside.touch.tolist() == [True, False, False, False]
