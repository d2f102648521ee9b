"""What is edited is what ``convert`` makes of the files saved, byte for byte."""

import shutil

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cli import app
from postproc.geometry import transform_from_kuka
from postproc.jobs.convert import ConvertRequest, convert
from postproc.workbench import Bench
from postproc.workbench.edits import Edits, frame_of, moved_file, placed, things
from tests.workbench.conftest import job, settled


@pytest.fixture
def bench(tmp_path):
    made = Bench(*job(tmp_path))
    made.reload()
    settled(made.state)
    yield made
    made.close()


def converted(call, folder):
    """Run the call that saving names, and return its exit code and the files."""
    arguments = call.split()[1:]
    shutil.rmtree(folder / "out", ignore_errors=True)
    arguments[arguments.index("-o") + 1] = str(folder / "out")
    code = app.run([*arguments, "-q"])
    files = {path.name: path.read_bytes() for path in (folder / "out").glob("*")}
    return code, files


def test_pins_and_places_are_what_convert_makes(bench, tmp_path):
    start = dict(bench.program())
    for edit, answer in (
        (lambda: bench.pin(5, 60.0), "holes.pins.csv"),
        (
            lambda: bench.move(("part", 0), [2046.0, 4.0, 1000.0], [-90.0, 0.0, 90.0]),
            "cell.moved.toml",
        ),
    ):
        edit()
        assert "error" not in settled(bench.state)
        saved = bench.save()
        assert any(name.endswith(answer) for name in saved["files"])
        code, files = converted(saved["call"], tmp_path)
        assert bench.state()["good"] == (code == 0)
        assert files == bench.program()
        assert files != start
    for _ in range(2):
        bench.step(-1)
    settled(bench.state)
    assert bench.program() == start
    bench.step(1)
    settled(bench.state)
    assert bench.state()["pins"] == {bench_name(bench, 5): 60.0}


def bench_name(bench, tag):
    return bench.source.read_text().splitlines()[tag + 1].split(",")[0]


def test_a_pose_looked_at_is_the_pose_planned(bench, tmp_path):
    """The pose answered at once is that of the plan with the pin; class, joints, stiffness."""
    verdicts = set()
    for tag, spin in ((3, 40.0), (8, 75.0), (10, 0.0)):
        seen = bench.pose(tag, spin)
        pins = tmp_path / "pins.csv"
        pins.write_text(f"tag,spin_deg\n{bench_name(bench, tag)},{spin:g}\n")
        made = convert(ConvertRequest(str(bench.source), str(bench.cell), pins=str(pins)))
        plan = made.plan
        assert seen["free"] == made.good
        verdicts.add(made.good)
        if not made.good:
            continue
        assert seen["stiffness_N_per_mm"] == pytest.approx(plan.stiffness[tag] * 1e-3, rel=1e-3)
        off = np.abs(plan.q[plan.tag == tag] - np.array(seen["q"])).max(axis=1).min()
        assert off < np.radians(2.0)  # the stroke ends a few mm off the tag
    assert verdicts == {True, False}


def test_a_pose_that_cannot_be_says_why(bench):
    kinds = {bench.pose(3, spin)["words"].split(":")[0] for spin in range(-180, 180, 20)}
    assert {"free", "joint limit"} <= kinds
    assert kinds <= {"free", "collision", "singularity", "joint limit", "out of reach"}


def test_reach_of_a_moved_part_is_that_of_convert(bench, tmp_path):
    there = {"thing": ("part", 0), "abc_deg": [-90.0, 0.0, 90.0]}
    assert bench.reach(xyz_mm=[2050.0, 0.0, 1000.0], **there)["words"] == "12 free"
    far = bench.reach(xyz_mm=[5050.0, 0.0, 1000.0], **there)
    assert far["words"] == "12 out of reach"
    bench.move(xyz_mm=[5050.0, 0.0, 1000.0], **there)
    state = settled(bench.state)
    assert not state["good"]
    assert bench.program() == {}
    code, _ = converted(bench.save()["call"], tmp_path)
    assert code == 1


@pytest.mark.slow
def test_why_and_its_cure_as_keys_of_the_cell(bench, tmp_path):
    """What is applied is what ``convert`` then calls good; undo takes it back, a move stays."""
    bench.move(("part", 0), [4550.0, 0.0, 1000.0], [-90.0, 0.0, 90.0])
    assert not settled(bench.state)["good"]
    bench.ask("why")
    (cause,) = settled(bench.state)["causes"]
    assert "out of reach" in cause["text"]
    assert cause["cell"]
    bench.cure(0)
    state = settled(bench.state)
    assert state["good"]
    assert state["causes"] == []
    assert 1000.0 < state["things"][0]["xyz_mm"][0] < 4550.0
    code, _ = converted(bench.save()["call"], tmp_path)
    assert code == 0
    bench.step(-1)
    assert not settled(bench.state)["good"]


@pytest.mark.slow
def test_the_best_place_is_gone_to(bench):
    assert not bench.state()["has_place"]
    bench.ask("place")
    state = settled(bench.state)
    assert state["good"], state
    assert state["has_place"]
    assert state["undo"] == 1
    assert b"as the full plan proves" in bench.place()


def test_the_neighbourhood_is_planned_at_once_and_all_else_stays(bench):
    """The pin counts, tags far from it keep their spin; the plan that is shown is not touched."""
    plan = bench._shown.conversion.plan
    before = dict(zip(plan.tag.tolist(), np.degrees(plan.spin).tolist(), strict=True))
    bench.pin(2, 60.0)
    found = bench.around(2)
    spins = dict(zip(found["tags"], found["spin_deg"], strict=True))
    assert found["good"], found
    assert spins[2] == pytest.approx(60.0)
    assert max(spins) < len(before) - 1
    for tag in (9, 10):
        assert spins[tag] == pytest.approx(before[tag], abs=0.01)


def test_tools_and_fixtures_move_as_the_file_has_them(tmp_path):
    cell, _ = job(tmp_path, holes=1)
    before = load_cell(cell)
    for thing in things(before):
        frame = frame_of(before, thing)
        moved = [frame["xyz_mm"][0] + 12.5, *frame["xyz_mm"][1:]]
        abc = [round(v + 3.0, 6) for v in frame["abc_deg"]]
        edits = Edits().moved(thing, moved, abc)
        file = moved_file(cell, edits)
        file.write_bytes(edits.cell_toml(cell))
        after = load_cell(file)
        assert frame_of(after, thing)["xyz_mm"] == pytest.approx(moved, abs=1e-6)
        wanted = placed(before, thing, transform_from_kuka(moved, abc))
        for one, other in zip(after.solids, wanted.solids, strict=True):
            assert np.allclose(one.T_owner_mesh, other.T_owner_mesh, atol=1e-8), thing
        others = [other for other in things(before) if other != thing]
        assert all(frame_of(after, other) == frame_of(before, other) for other in others)
