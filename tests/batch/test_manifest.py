import json
import os
import signal
import subprocess
import sys

import pytest

from postproc.batch.check import junit_xml
from postproc.batch.child import JobResult
from postproc.batch.manifest import JOURNAL, NAME, Manifest, folder_lock
from postproc.errors import DataError

MARKS = {"input": "1", "cell": "2"}


def _landed(folder, key="a.cls", content=b"x"):
    manifest = Manifest.load(folder)
    (folder / "A.src").write_bytes(content)
    manifest.record(
        JobResult(key, "ok", "A", {"A.src": content}, tags=3), MARKS, {"A.src": content}
    )
    return manifest


def test_a_result_is_current_until_anything_changes(tmp_path):
    _landed(tmp_path).save()
    manifest = Manifest.load(tmp_path)
    assert manifest.is_current("a.cls", MARKS)
    assert not manifest.is_current("a.cls", {**MARKS, "cell": "3"})
    assert not manifest.is_current("b.cls", MARKS)
    (tmp_path / "A.src").write_bytes(b"edited by hand")
    assert not manifest.is_current("a.cls", MARKS)


def test_the_journal_of_a_killed_run_counts_but_not_its_torn_last_line(tmp_path):
    _landed(tmp_path)
    with (tmp_path / JOURNAL).open("ab") as stream:
        stream.write(b'{"key": "b.cls", "entry": {"sta')
    manifest = Manifest.load(tmp_path)
    assert manifest.is_current("a.cls", MARKS)
    assert "b.cls" not in manifest.entries
    manifest.save()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["A.src", NAME]


@pytest.mark.parametrize(
    ("status", "error", "is_settled"),
    [
        ("failed", "a.cls:9: error PLN101: out of reach", True),
        ("error", "a.cls:1: error IO010: no format", True),
        ("error", "cell.toml:1: error CEL001: no such key", True),
        ("error", "out/A.src:1: error IO003: disk full", False),
        ("error", "a.cls:1: error BAT013: its name is taken", False),
        ("error", "a.cls:1: error BAT033: another version", False),
        ("error", "part.step:1: error PLG008: a STEP file is read by an extra", False),
        ("crash", "a.cls:1: error BAT022: the worker died", False),
        ("timeout", "a.cls:1: error BAT021: not done", False),
        ("memory", "a.cls:1: error BAT020: too much", False),
    ],
)
def test_a_bad_result_stays_where_it_follows_from_the_input(tmp_path, status, error, is_settled):
    manifest = Manifest.load(tmp_path)
    manifest.record(JobResult("a.cls", status, errors=(error,)), MARKS, {})
    assert manifest.is_current("a.cls", MARKS) == is_settled
    assert not manifest.is_current("a.cls", {**MARKS, "input": "2"})


def test_a_run_after_a_killed_one_begins_with_a_whole_journal(tmp_path):
    _landed(tmp_path)
    with (tmp_path / JOURNAL).open("ab") as stream:
        stream.write(b'{"key": "b.cls", "entry": {"sta')
    (tmp_path / ".A.src.ab_0123z.part").write_bytes(b"half")
    (tmp_path / ".mine.part").write_bytes(b"a file of the user")
    manifest = Manifest.load(tmp_path)
    manifest.begin()
    manifest.record(JobResult("c.cls", "ok", "C", {}), MARKS, {})
    assert set(Manifest.load(tmp_path).entries) == {"a.cls", "c.cls"}
    assert sorted(p.name for p in tmp_path.iterdir()) == [".mine.part", JOURNAL, "A.src", NAME]


def test_a_journal_on_a_full_disk_has_no_torn_lines(tmp_path):
    import resource

    manifest = _landed(tmp_path)
    before = (tmp_path / JOURNAL).read_bytes()
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 20, old[1]))
        manifest.record(JobResult("b.cls", "ok", "B", {}), MARKS, {})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
    assert (tmp_path / JOURNAL).read_bytes() == before
    assert manifest.entries["b.cls"]["status"] == "ok"


def test_a_result_of_what_could_not_be_read_is_never_current(tmp_path):
    manifest = Manifest.load(tmp_path)
    marks = {**MARKS, "cell": "-"}
    manifest.record(JobResult("a.cls", "ok", "A", {}), marks, {})
    assert not manifest.is_current("a.cls", marks)


@pytest.mark.parametrize("name", ["../x.src", "/etc/x", "..", ""])
def test_a_manifest_names_files_of_its_folder_only(tmp_path, name):
    _landed(tmp_path).save()
    document = json.loads((tmp_path / NAME).read_text())
    document["entries"]["a.cls"]["files"] = {name: "0"}
    (tmp_path / NAME).write_text(json.dumps(document))
    with pytest.raises(DataError, match="BAT010"):
        Manifest.load(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"schema": "other", "entries": {}}',
        '{"schema": "postproc.manifest/1", "entries": {"a": 3}}',
    ],
)
def test_a_foreign_manifest_is_not_overwritten(tmp_path, text):
    (tmp_path / NAME).write_text(text)
    with pytest.raises(DataError, match="BAT010"):
        Manifest.load(tmp_path)


def test_a_second_batch_is_refused_with_the_pid_of_the_first(tmp_path):
    code = (
        "import sys; from pathlib import Path; from postproc.batch.manifest import folder_lock\n"
        "with folder_lock(Path(sys.argv[1])):\n print('held', flush=True); sys.stdin.read()"
    )
    first = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert first.stdout is not None
    assert first.stdout.readline() == "held\n"
    with pytest.raises(DataError, match=f"BAT011.*pid {first.pid}, since"), folder_lock(tmp_path):
        pass
    first.kill()
    first.communicate()
    with folder_lock(tmp_path):
        assert str(os.getpid()) in (tmp_path / ".postproc-lock").read_text()
    assert list(tmp_path.iterdir()) == []


def test_junit_counts_and_escapes():
    text = junit_xml(
        {
            "a": {"status": "ok", "errors": []},
            "b": {"status": "failed", "errors": ["b:1: error <&> \x00"]},
            "c": {"status": "crash", "errors": []},
        }
    ).decode()
    assert 'tests="3" failures="1" errors="1"' in text
    assert "&lt;&amp;&gt; ?" in text
