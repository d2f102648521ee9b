"""Whole batches through the command line: what is redone, what is removed, what is refused."""

import json
import os
from pathlib import Path

import pytest

from postproc.batch import manifest as manifest_module
from postproc.batch.manifest import JOURNAL
from postproc.cli.app import run as run_cli
from postproc.errors import ReadError, SourceRef

from .conftest import CELL, HEADER, holes, row


def test_one_bad_input_never_stops_the_others(batch, work):
    done = batch()
    assert done.code == 1
    assert done.document["inputs"] == 3
    assert done.document["failed"] == ["parts/far.csv"]
    assert "parts/far.csv:2: error PLN101" in done.err
    names = {p.name for p in (work / "out").iterdir()}
    assert names == {"a.src", "a.dat", "b.src", "b.dat", "manifest.json"}
    manifest = json.loads((work / "out" / "manifest.json").read_text())
    assert manifest["entries"]["parts/a.csv"]["tags"] == 3
    assert str(work) not in (work / "out" / "manifest.json").read_text()


def test_only_what_changed_is_redone(batch, work, snapshot):
    batch()
    before = snapshot("out")
    second = batch()
    again = second.document
    assert (again["done"], again["kept"], again["not_retried"]) == (0, 2, 1)
    assert (again["failed"], second.code) == (["parts/far.csv"], 1)
    assert "parts/far.csv:2: error PLN101" in second.err
    assert snapshot("out") == before
    (work / "parts" / "b.csv").write_text(HEADER + row(40))
    assert batch().document["kept"] == 1
    after = snapshot("out")
    assert after["a.src"] == before["a.src"]
    assert after["b.src"] != before["b.src"]
    (work / "out" / "a.src").write_text("edited by hand")
    assert batch().document["kept"] == 1
    assert snapshot("out") == after
    (work / "cell.toml").write_text(f"{CELL}# another cell\n")
    assert batch().document["kept"] == 0
    assert batch("--force").document["kept"] == 0


def test_a_failing_input_loses_its_old_program(batch, work):
    batch()
    (work / "parts" / "a.csv").write_text(HEADER + row(9000))
    done = batch()
    assert done.code == 1
    assert "parts/a.csv" in done.document["failed"]
    assert not (work / "out" / "a.src").exists()


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["--cell", "broken.toml"], "CEL001"),
        (["--cell", "missing.toml"], "IO001"),
        (["--model", "missing.toml"], "IO001"),
        (["--objective", "stiffest"], "PLN202"),
        (["--split", "regions:3"], "BAT040"),
    ],
)
def test_a_wrong_call_changes_nothing(batch, work, snapshot, arguments, code):
    batch()
    before = snapshot("out")
    (work / "broken.toml").write_text("robot = [")
    done = batch(*arguments)
    assert (done.code, done.document["schema"]) == (2, "postproc.error/1")
    assert f"error {code}" in done.err.splitlines()[0]
    assert snapshot("out") == before


def test_outputs_of_vanished_inputs_stay_until_pruned(batch, work):
    batch()
    assert batch(inputs=("parts/a.csv",)).document["vanished"] == []
    (work / "parts" / "b.csv").unlink()
    assert batch().document["vanished"] == ["b.dat", "b.src"]
    assert (work / "out" / "b.src").exists()
    assert batch("--prune").document["pruned"] == ["b.dat", "b.src"]
    assert not (work / "out" / "b.src").exists()
    assert batch().document["vanished"] == []


def test_a_program_moves_from_one_input_to_another(batch, work):
    """A new input that comes first takes the plain name; nothing of either gets lost."""
    (work / "parts" / "far.csv").unlink()
    batch()
    (work / "parts" / "A").mkdir()
    (work / "parts" / "A" / "b.csv").write_text(holes(3))
    done = batch()
    assert done.code == 0
    programs = {key: e["program"] for key, e in done.document["entries"].items()}
    assert programs["parts/A/b.csv"] == "b"
    assert programs["parts/b.csv"].startswith("b_")
    fresh = batch(output="fresh")
    assert fresh.document["entries"] == done.document["entries"]
    assert {p.name for p in (work / "out").iterdir()} == {
        p.name for p in (work / "fresh").iterdir()
    }


def test_a_part_of_earlier_inputs_keeps_its_programs(batch, work, snapshot):
    (work / "parts" / "far.csv").unlink()
    (work / "parts" / "A").mkdir()
    (work / "parts" / "A" / "b.csv").write_text(holes(3))
    assert batch().code == 0
    before = snapshot("out")
    again = batch(inputs=("parts/b.csv",))
    assert (again.code, again.document["kept"]) == (0, 1)
    assert snapshot("out") == before


def test_two_programs_of_one_name_are_never_written_over_each_other(batch, work, snapshot):
    (work / "cell.toml").write_text(f"{CELL}[krl]\nmax_points_per_file = 12\n")
    for name in ("far", "a", "b"):
        (work / "parts" / f"{name}.csv").unlink()
    (work / "parts" / "wing.csv").write_text(holes(6))  # becomes wing, wing_001 and wing_002
    (work / "parts" / "wing_001.csv").write_text(holes(1))
    done = batch()
    assert done.document["failed"] == ["parts/wing_001.csv"]
    assert "error BAT013: its program wing_001 has the name of a program of parts/wing.csv" in (
        done.err
    )
    before = snapshot("out")
    assert batch().document["failed"] == ["parts/wing_001.csv"]
    assert snapshot("out") == before
    # the same name in a later call
    (work / "later").mkdir()
    (work / "later" / "wing.csv").write_text(holes(1))
    assert batch(inputs=("later",)).document["failed"] == ["later/wing.csv"]
    assert {k: v for k, v in snapshot("out").items() if k != "manifest.json"} == {
        k: v for k, v in before.items() if k != "manifest.json"
    }


def test_check_finds_a_difference_and_writes_nothing(batch, work, snapshot):
    (work / "parts" / "far.csv").unlink()
    batch()
    before = snapshot("out")
    done = batch("--check", "--junit", "checks.xml")
    assert (done.code, done.document["same"]) == (0, True)
    (work / "parts" / "a.csv").write_text(HEADER + row(0) + row(20.5) + row(40))
    done = batch("--check", "--junit", "checks.xml")
    assert (done.code, done.document["same"]) == (1, False)
    assert list(done.document["differences"]) == ["a"]
    kinds = done.document["differences"]["a"]["counts"]
    assert kinds["moved"] > 0
    assert snapshot("out") == before
    assert 'failures="1"' in (work / "checks.xml").read_text()


def test_check_finds_what_is_missing_and_what_is_too_much(batch, work):
    (work / "parts" / "far.csv").unlink()
    batch()
    (work / "out" / "a.dat").unlink()
    (work / "parts" / "b.csv").unlink()
    done = batch("--check")
    assert done.code == 1
    assert {k: e["status"] for k, e in done.document["entries"].items()} == {
        "parts/a.csv": "different", "parts/b.csv": "vanished",
    }  # fmt: skip
    assert "out/a.dat:1: error BAT016: is missing" in done.err


def test_unreadable_inputs_and_folders(batch, work):
    (work / "parts" / "broken.cls").write_bytes(bytes(range(256)))
    (work / "list.txt").write_text("parts/*.c*\nparts/nowhere.cls\n")
    done = batch(inputs=("@list.txt",))
    assert done.code == 1
    bad = {"parts/broken.cls", "parts/far.csv", "parts/nowhere.cls"}
    assert set(done.document["failed"]) == bad
    assert "parts/nowhere.cls:1: error IO001" in done.err
    (work / "taken").write_text("a file")
    done = batch(output="taken")
    assert (done.code, done.document["schema"]) == (2, "postproc.error/1")
    assert done.err.startswith("taken:1: error BAT012")


def test_an_input_that_gives_read_errors_is_one_failure(batch, work):
    (work / "parts" / "a.csv").unlink()
    # reading address 0 of a process is an input/output error, for root too
    (work / "parts" / "a.csv").symlink_to("/proc/self/mem")
    done = batch()
    assert "parts/a.csv:1: error IO002: cannot be read: Input/output error" in done.err
    assert set(done.document["failed"]) == {"parts/a.csv", "parts/far.csv"}


def test_a_read_only_folder_is_refused(batch, work, monkeypatch):
    folder = work / "out"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # root may write anyway: let the system say no
        real = os.open

        def denied(path, *args, **kwargs):
            if Path(path).parent.name == "out":
                raise PermissionError(13, "Permission denied")
            return real(path, *args, **kwargs)

        monkeypatch.setattr(os, "open", denied)
    done = batch()
    assert (done.code, done.document["schema"]) == (2, "postproc.error/1")
    assert done.err.splitlines()[0] == "out:1: error BAT012: cannot be written: Permission denied"
    assert list(folder.iterdir()) == []


def test_a_program_that_cannot_be_written_is_one_failure(batch, work, monkeypatch):
    real = manifest_module.write_files

    def full(contents, **options):
        if any(path.name == "a.src" for path in contents):
            raise ReadError("IO003", "cannot be written: No space left on device", SourceRef("a"))
        real(contents, **options)

    monkeypatch.setattr(manifest_module, "write_files", full)
    done = batch()
    assert done.code == 1
    assert set(done.document["failed"]) == {"parts/a.csv", "parts/far.csv"}
    assert (work / "out" / "b.src").exists()
    monkeypatch.undo()


def test_when_the_manifest_cannot_be_written_the_journal_stays(batch, work, monkeypatch):
    real = manifest_module.write_files

    def full(contents, **options):
        if any(path.name == "manifest.json" for path in contents):
            raise ReadError("IO003", "cannot be written: No space left on device", SourceRef("m"))
        real(contents, **options)

    (work / "parts" / "far.csv").unlink()
    with monkeypatch.context() as patch:
        patch.setattr(manifest_module, "write_files", full)
        done = batch()
    assert done.code == 1
    assert "No space left" in done.err
    assert (work / "out" / JOURNAL).exists()
    assert batch().document["kept"] == 2
    assert not (work / "out" / JOURNAL).exists()


def test_names_that_are_no_text(batch, work):
    for name in ("a", "b", "far"):
        (work / "parts" / f"{name}.csv").unlink()
    strange = os.fsdecode(b"parts/caf\xe9.csv")
    (work / strange).write_text(holes(1))
    done = batch()
    assert done.code == 0
    assert batch().document["kept"] == 1
    assert list((work / "out").glob("*.src"))


def test_a_batch_without_a_cell_is_refused(work, capsys):

    assert run_cli(["batch", "parts", "-o", "out"]) == 2
    assert "BAT004" in capsys.readouterr().err.splitlines()[0]


def test_rules_that_match_nothing_are_told(batch, work):
    (work / "batch.toml").write_text('[[input]]\nmatch = "typo*"\nunits = "inch"\n')
    assert "warning BAT005: match = 'typo*'" in batch("--config", "batch.toml").err


def test_warnings_are_told_once_a_kind_and_kept_with_each_program(batch, work):
    """So little memory that each program is too large for it: of `convert` that is a warning."""
    small = f"{CELL}[krl]\nmemory_mb = 0.001\n"
    (work / "cell.toml").write_text(small)
    done = batch()
    assert done.err.count("warning memory") == 1
    assert "in 2 programs" in done.err
    for key in ("parts/a.csv", "parts/b.csv"):
        lines = done.document["entries"][key]["warnings"]
        assert sum("warning memory" in line for line in lines) == 1
    again = batch()
    assert again.document["kept"] == 2
    assert again.err.count("warning memory") == 1


def test_sections_of_a_file_that_names_its_tool_serve_the_file(work, batch, capfd):
    """Each section begins with the tool that it needs, which is in hand already."""
    holes = "".join(
        f"RAPID\nGOTO/{x}.,0.,3.,0.,0.,1.\nFEDRAT/MMPM,200.\nGOTO/{x}.,0.,-5.\n"
        f"RAPID\nGOTO/{x}.,0.,30.\n"
        for x in (0, 50, 100)
    )
    part = work / "part.cls"
    part.write_text(
        "TOOL PATH/H,TOOL,DRILL\nTLDATA/MILL,10.,0.,86.,0.,0.\nMSYS/0,0,0,1,0,0,0,1,0\n"
        f"LOAD/TOOL,1\nSPINDL/3000,RPM,CLW\n{holes}SPINDL/OFF\nEND-OF-PATH\n"
    )
    done = batch("--split", "count:3", inputs=("part.cls",))
    assert done.code == 0
    words = ["verify", "out/part.src", "--cell", "cell.toml", "--against", "part.cls"]
    assert run_cli(words) == 0
    assert "PP_TOOL_CHANGE is called" in "".join(capfd.readouterr())


def test_quiet_names_failing_inputs_and_counts_are_words(work, capfd):
    assert run_cli(["batch", "parts", "--cell", "cell.toml", "-o", "out", "-q"]) == 1
    told = capfd.readouterr()
    assert told.out == ""
    assert "parts/far.csv:2: error PLN101" in told.err
    call = ["batch", "parts", "--cell", "cell.toml", "-o", "out"]
    (work / "parts" / "b.csv").write_text(HEADER + row(40))
    run_cli(call)
    said = capfd.readouterr().out.splitlines()[0]
    assert said == (
        "converted 1 of 3, failed 1 (1 not tried again since nothing changed; --force does), "
        "unchanged 1"
    )
