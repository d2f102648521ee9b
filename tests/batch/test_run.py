"""Whole batches through the command line: what is redone, what survives, what is refused."""

import json
import os
import random
import signal
import subprocess
import sys
import time

import pytest

HOLES = "x,y,z,i,j,k,depth\n"


def row(x, y=0.0):
    return f"{x:.3f},{y:.3f},0,0,0,1,5\n"


def test_one_bad_input_never_stops_the_others(batch, work):
    code, document, err = batch()
    assert code == 1
    assert document["inputs"] == 3
    assert document["failed"] == ["parts/far.csv"]
    assert "parts/far.csv:2: error PLN101" in err
    names = {p.name for p in (work / "out").iterdir()}
    assert names == {"a.src", "a.dat", "b.src", "b.dat", "manifest.json"}
    manifest = json.loads((work / "out" / "manifest.json").read_text())
    assert manifest["entries"]["parts/a.csv"]["tags"] == 4


def test_only_what_changed_or_failed_is_redone(batch, work, snapshot):
    batch()
    before = snapshot(work / "out")
    _, document, _ = batch()
    assert (document["done"], document["kept"]) == (1, 2)
    assert snapshot(work / "out") == before
    (work / "parts" / "b.csv").write_text(HOLES + row(40))
    _, document, _ = batch()
    assert document["kept"] == 1
    after = snapshot(work / "out")
    assert after["a.src"] == before["a.src"]
    assert after["b.src"] != before["b.src"]
    (work / "cell.toml").write_text((work / "cell.toml").read_text() + "# another cell\n")
    assert batch()[1]["kept"] == 0
    assert batch("--force")[1]["kept"] == 0


def test_a_failing_input_loses_its_old_program(batch, work):
    batch()
    (work / "parts" / "a.csv").write_text(HOLES + row(9000))
    code, document, _ = batch()
    assert code == 1
    assert "parts/a.csv" in document["failed"]
    assert not (work / "out" / "a.src").exists()


def test_outputs_of_vanished_inputs_stay_until_pruned(batch, work):
    batch()
    (work / "parts" / "b.csv").unlink()
    _, document, _ = batch()
    assert document["vanished"] == ["b.dat", "b.src"]
    assert (work / "out" / "b.src").exists()
    _, document, _ = batch("--prune")
    assert document["pruned"] == ["b.dat", "b.src"]
    assert not (work / "out" / "b.src").exists()
    assert batch()[1]["vanished"] == []


def test_check_finds_a_difference_and_writes_nothing(batch, work, snapshot):
    (work / "parts" / "far.csv").unlink()
    batch()
    before = snapshot(work / "out")
    code, document, _ = batch("--check", "--junit", "checks.xml")
    assert (code, document["same"]) == (0, True)
    (work / "parts" / "a.csv").write_text(HOLES + row(0) + row(20.5) + row(40) + row(60))
    code, document, _ = batch("--check", "--junit", "checks.xml")
    assert (code, document["same"]) == (1, False)
    assert document["differences"]["a.src"]["same"] is False
    assert snapshot(work / "out") == before
    assert 'failures="1"' in (work / "checks.xml").read_text()


def test_the_number_of_workers_changes_no_byte(batch, work, snapshot):
    batch(output="one")
    batch("--jobs", "1", output="two")
    assert snapshot(work / "one") == snapshot(work / "two")


def test_a_killed_batch_goes_on_to_the_same_folder(batch, work, snapshot):
    for number in range(6):
        (work / "parts" / f"p{number}.csv").write_text(HOLES + row(20 * number))
    batch(output="whole")
    command = [sys.executable, "-m", "postproc", "batch", "parts", "-o", "cut"]
    command += ["--cell", "cell.toml", "--jobs", "2"]
    moments = random.Random(7)
    for _ in range(4):
        running = subprocess.Popen(
            command, cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        time.sleep(moments.uniform(0.5, 3.5))
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()
    batch(output="cut")
    assert snapshot(work / "cut") == snapshot(work / "whole")


def test_unreadable_inputs_and_folders(batch, work):
    (work / "parts" / "broken.cls").write_bytes(bytes(range(256)))
    code, document, err = batch()
    assert code == 1
    assert set(document["failed"]) == {"parts/broken.cls", "parts/far.csv"}
    (work / "taken").write_text("a file")
    code, document, err = batch(output="taken")
    assert (code, document) == (2, None)
    assert err.startswith("taken:1: error BAT012")


def test_a_batch_without_a_cell_is_refused(batch, work):
    done = subprocess.run(
        [sys.executable, "-m", "postproc", "batch", "parts", "-o", "out"],
        cwd=work, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "BAT004" in done.stderr.splitlines()[0]


@pytest.mark.parametrize("rule", ["region:100", "count:3", "operation"])
def test_large_inputs_become_several_programs_and_a_caller(batch, work, rule):
    (work / "cloud.csv").write_text(HOLES + "".join(row(20 * i, 30 * (i % 3)) for i in range(12)))
    code, document, err = batch("--split", rule, inputs=("cloud.csv",))
    assert code == 0, err
    programs = {e["program"] for e in document["entries"].values()}
    caller = (work / "out" / "cloud.src").read_text()
    assert all(f"{name}()" in caller for name in programs)
    assert sum(e["tags"] for e in document["entries"].values()) == 12


def test_one_more_hole_changes_only_its_own_region(batch, work, snapshot):
    rows = [row(20 * i) for i in range(20)]
    (work / "cloud.csv").write_text(HOLES + "".join(rows))
    batch("--split", "region:100", inputs=("cloud.csv",))
    before = snapshot(work / "out")
    rows.insert(7, row(130, 15))
    (work / "cloud.csv").write_text(HOLES + "".join(rows))
    _, document, _ = batch("--split", "region:100", inputs=("cloud.csv",))
    after = snapshot(work / "out")
    changed = {name for name in before | after if before.get(name) != after.get(name)}
    assert changed - {"manifest.json"} == {"cloud_X1Y0Z0.src"}
    assert document["done"] == 1


def test_a_cluster_gives_the_same_bytes_although_a_worker_dies(batch, work, snapshot):
    pytest.importorskip("distributed")
    batch(output="here")
    servers = []
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": work}
    try:
        base = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
        file = work / "scheduler.json"
        servers.append(
            subprocess.Popen(
                [*base, "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file)],
                **quiet,
            )
        )
        deadline = time.monotonic() + 30
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard"]
        worker += ["--nthreads", "1", "--no-nanny", "--host", "127.0.0.1"]
        servers += [subprocess.Popen(worker, **quiet) for _ in range(2)]
        running = subprocess.Popen(
            [sys.executable, "-m", "postproc", "batch", "parts", "-o", "there", "--cell",
             "cell.toml", "--dask", address], **quiet
        )  # fmt: skip
        time.sleep(4)
        servers[-1].kill()
        assert running.wait(timeout=60) == 1
    finally:
        for server in servers:
            server.kill()
            server.wait()
    assert snapshot(work / "there") == snapshot(work / "here")


def test_no_scheduler_is_one_line(batch):
    pytest.importorskip("distributed")
    code, _, err = batch("--dask", "tcp://127.0.0.1:9")
    assert code == 2
    assert "BAT031" in err.splitlines()[0]
