"""What --keep holds of an old program: poses to the byte, where they can be run and lose little."""

import re

import numpy as np
import pytest

from postproc.jobs import kept
from tests.places import FIXTURES

HEAD = "id,x,y,z,i,j,k,depth\n"
HOLES = [(f"H{i}", 60.0 * (i % 4), 50.0 * (i // 4), 0.0) for i in range(12)]
POSE = re.compile(r"LIN \{([^}]*)\}.*CAM line (\d+)")


@pytest.fixture
def made(tmp_path, cell, run):
    """Return a function: holes and more of the call to document and poses by id."""

    def convert(name, holes, *options, text=None):
        source, here = tmp_path / "part.csv", tmp_path / "here.toml"
        source.write_text(HEAD + "".join(f"{n},{x},{y},{z},0,0,1,5\n" for n, x, y, z in holes))
        here.write_text(cell.read_text() if text is None else text)
        out = tmp_path / name
        code, said, _ = run("convert", source, "--cell", here, "-o", out, "--json", *options)
        assert code == 0
        poses: dict[str, list[str]] = {}
        for pose, line in POSE.findall((out / "part.src").read_text()):
            poses.setdefault(holes[int(line) - 2][0], []).append(pose)
        return said, poses

    return convert


def test_nothing_changed_nothing_changes(made, tmp_path):
    made("old", HOLES)
    said, _ = made("new", HOLES, "--keep", tmp_path / "old")
    old, new = ((tmp_path / name / "part.src").read_bytes() for name in ("old", "new"))
    assert old == new
    assert said["kept"] == {
        **{"kept": 12, "turned": 0, "moved": 0, "new": 0},
        "gain_percent_if_free": 0.0,
    }


def test_a_program_kept_of_itself_stays_to_the_byte(tmp_path, run):
    """Examples of cuts, external axes, splines and a contour that comes back to where it began."""
    changed = []
    for case, source in (
        ("forms_pocket", "pocket.aptsource"),
        ("spline_points", "bead.csv"),
        ("trim_5axis", "trim.cls"),
        ("turntable", "ring.csv"),
    ):
        folder, out = FIXTURES / case, [tmp_path / f"{case}{k}" for k in range(2)]
        call = ("convert", folder / source, "--cell", folder / "cell.toml", "--json", "-o")
        assert run(*call, out[0])[0] == 0
        counts = run(*call, out[1], "--keep", out[0])[1]["kept"]
        old, new = ({p.name: p.read_bytes() for p in folder.glob("*.src")} for folder in out)
        changed += [case] * (old != new or counts["turned"] + counts["moved"] > 0)
    assert changed == []


def test_edits_change_what_they_edit_and_poses_stay_that_a_free_plan_would_turn(
    made, tmp_path, cell
):
    """The old program stands otherwise: its range of spins was another one."""
    text = cell.read_text()
    narrow = text + "[optimize]\nrange_deg = [-60, 60]\npins = { H3 = 17.25 }\n"
    loose = text + "[optimize]\nkeep_loss_percent = 50\n"
    _, old = made("old", HOLES, text=narrow)
    _, free = made("free", HOLES, text=loose)
    edits = {
        "moved": [(n, x + 1.5 * (n == "H5"), y, z) for n, x, y, z in HOLES],
        "added": [*HOLES[:6], ("X", 130.0, 75.0, 0.0), *HOLES[6:]],
        "removed": HOLES[:4] + HOLES[5:],
    }
    wrong = []
    for name, holes in edits.items():
        said, new = made(name, holes, "--keep", tmp_path / "old" / "part.src", text=loose)
        same = [n for n in new if n in old and (name, n) != ("moved", "H5")]
        wrong += [f"{name} {n}" for n in same if new[n] != old[n]]
        counts = said["kept"]
        wrong += [name] * (counts["kept"] != len(same) or counts["turned"] != 0)
        wrong += [name] * (
            counts["new"] != (name == "added") or counts["moved"] != (name == "moved")
        )
    assert wrong == []
    assert sum(old[n] != free[n] for n in old) > 0


def test_a_pose_that_loses_more_than_the_cell_lets_it_is_planned_anew(made, tmp_path, cell):
    pinned = cell.read_text() + "[optimize]\npins = { H3 = -100, H4 = 15.5 }\n"
    _, old = made("old", HOLES, text=pinned)
    _, free = made("free", HOLES)
    said, new = made("new", HOLES, "--keep", tmp_path / "old")
    assert new["H3"] != old["H3"]
    assert said["kept"]["kept"] + said["kept"]["turned"] == 12
    assert said["kept"]["gain_percent_if_free"] < 2.0
    assert np.mean([new[n] == old[n] for n in old]) > 0.5
    assert free["H3"] != old["H3"]


def test_what_is_no_program_of_this_arm_stops_by_name(tmp_path, cell, run, made):
    made("old", HOLES)
    (tmp_path / "empty").mkdir()
    (tmp_path / "torn.src").write_text("DEF torn( )\nLIN {X 1,Y\nEND\n")
    small = re.sub('model = "[^"]*"', 'model = "kuka_kr10_r1100_2"', cell.read_text())
    other = tmp_path / "other.toml"
    other.write_text(small)
    source, out, wrong = tmp_path / "part.csv", tmp_path / "out", []
    for what, where, code in (
        (tmp_path / "none.src", cell, "PIN008"),
        (tmp_path / "empty", cell, "PIN008"),
        (tmp_path / "torn.src", cell, "KRL"),
        (tmp_path / "old", other, "PIN009"),
    ):
        found, _, said = run(
            "convert", source, "--cell", where, "-o", out, "--json", "--keep", what
        )
        if found != 2 or code not in said.splitlines()[0] or out.exists():
            wrong.append((str(what), found, said))
    assert wrong == []


@pytest.mark.usefixtures("batch_here")
def test_a_batch_keeps_and_names_what_it_kept_of(made, tmp_path, cell, run):
    made("old", HOLES)
    (tmp_path / "part.csv").write_text(
        (tmp_path / "part.csv").read_text().replace("60.0,50", "61,50")
    )
    call = ("batch", tmp_path / "part.csv", "--cell", cell, "-j", "1", "--json", "-o")
    code, said, _ = run(*call, tmp_path / "one")
    code, said, _ = run(*call, tmp_path / "two", "--keep", tmp_path / "one" / "manifest.json")
    assert code == 0
    marks = [entry["fingerprint"] for entry in said["entries"].values()]
    assert len(marks[0]["keep"]) == 64
    one, two = ((tmp_path / name / "part.src").read_bytes() for name in ("one", "two"))
    assert one == two
    assert run(*call, tmp_path / "two", "--keep", tmp_path / "one" / "manifest.json")[1]["kept"]
    again = (*call, tmp_path / "one", "--keep", tmp_path / "one")  # of the folder that it writes
    said = [run(*again)[1]["kept"] for _ in range(2)]
    assert not said[0]
    assert said[1]


def test_what_fails_again_and_again_costs_only_what_is_near(made, tmp_path, cell, monkeypatch):
    calls = []

    def dear(plan, free, cell, held):
        calls.append(plan)
        bad = np.zeros(len(held), dtype=bool)
        if len(calls) <= 6:
            bad[np.flatnonzero(held)[-1]] = True
        return bad

    monkeypatch.setattr(kept, "_dear", dear)
    monkeypatch.setattr(kept, "_stands", lambda *_: False)
    many = [(f"H{i}", 20.0 * (i % 6), 20.0 * (i // 6), 0.0) for i in range(48)]
    made("old", many)
    calls.clear()
    held = []
    monkeypatch.setattr(
        kept, "_holding", lambda path, old, pose: held.append((pose >= 0).sum()) or path
    )
    made("new", many, "--keep", tmp_path / "old")
    assert held[0] > held[-1] > 0
    assert len(held) == 7
