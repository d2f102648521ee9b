"""What the workbench answers, to whom, and that it outlives bad input."""

import json
import socket
import time

import pytest

from postproc.cli import app
from tests.workbench.conftest import Running, job

PART = {"kind": "part", "index": 0}


@pytest.mark.parametrize(
    ("name", "asked", "status"),
    [
        ("another token", {"token": "a" * 32}, 404),
        ("no token", {"token": "x"}, 404),
        ("a name that a foreign site points here", {"host": "evil.example:{port}"}, 403),
        ("this machine at another port", {"host": "127.0.0.1:1"}, 403),
        ("a page of another site", {"origin": "http://evil.example"}, 403),
        ("a page without an address", {"origin": "null"}, 403),
        ("its own page", {"origin": "http://127.0.0.1:{port}"}, 200),
        ("a tab of its own", {}, 200),
        ("the other name of this machine", {"host": "localhost:{port}"}, 200),
    ],
)
def test_who_is_answered(running, name, asked, status):
    given = {key: value.format(port=running.port) for key, value in asked.items()}
    for path in ("", "state", "plan", "map"):
        assert running.call(path, **given)[0] == status, name


def test_changes_come_from_the_page_alone(running):
    before = running.settled()
    for origin in ("", "null", "http://evil.example", f"https://127.0.0.1:{running.port}"):
        for name in ("pin", "save", "move", "reload", "undo"):
            content = {"tag": 0, "spin_deg": 10}
            assert running.call(name, content, origin=origin)[0] == 403, (origin, name)
    assert running.call("pin", method="GET")[0] == 405
    assert running.state()["number"] == before["number"]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("pin", b"\xff"),
        ("pin", b"[" * 5000),
        ("pin", b"[1]"),
        ("pin", b" " * 70_000),
        ("pin", {"tag": 99, "spin_deg": 0}),
        ("pin", {"tag": 0.5, "spin_deg": 0}),
        ("pin", {"tag": 0, "spin_deg": 1e6}),
        ("pin", b'{"tag": 0, "spin_deg": NaN}'),
        ("pin", {"tag": 0, "spin_deg": "../../x"}),
        ("unpin", {"tag": 0}),
        ("pose", {"tag": -1, "spin_deg": 0}),
        ("around", {"tag": 99}),
        ("move", {**PART, "xyz_mm": [0, 0], "abc_deg": [0, 0, 0]}),
        ("move", {**PART, "index": 7, "xyz_mm": [0, 0, 0], "abc_deg": [0, 0, 0]}),
        ("move", {**PART, "kind": "robot", "xyz_mm": [0, 0, 0], "abc_deg": [0, 0, 0]}),
        ("reach", {**PART, "xyz_mm": [0, 0, 1e7], "abc_deg": [0, 0, 0]}),
        ("reach", {**PART, "index": -1, "xyz_mm": [0, 0, 0], "abc_deg": [0, 0, 0]}),
        ("save", {}),
    ],
)
def test_bad_requests_get_one_line_and_change_nothing(running, name, content):
    before = running.settled()
    status, body, _ = running.call(name, content)
    answer = json.loads(body)
    assert status == 400
    assert answer["error"].count("\n") == 0
    assert "error UI01" in answer["error"]
    assert running.state()["number"] == before["number"]


def test_the_page_may_ask_nobody_else(running):
    status, page, headers = running.call("")
    assert status == 200
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert "unsafe-eval" not in policy
    assert "'unsafe-inline'" not in policy.split("script-src", 1)[1].split(";")[0]
    assert headers["Referrer-Policy"] == "no-referrer"
    assert running.token not in page.decode()


def test_tabs_that_die_in_the_middle_harm_nobody(running):
    running.settled()
    for _ in range(20):
        dying = socket.create_connection(("127.0.0.1", running.port))
        dying.sendall(f"POST /{running.token}/pose HTTP/1.1\r\nHost: 127.0.0.1".encode())
        dying.close()
    first, second = running.state(), running.state()
    assert first == second
    assert first["plan"]


@pytest.mark.slow
def test_files_that_turn_bad_are_said_in_the_page_and_mended_by_a_reload(tmp_path):
    cell, holes = job(tmp_path, holes=2)
    good = cell.read_text()
    bench = Running(cell, holes)
    try:
        assert bench.settled()["good"]
        for file, content, code in (
            (cell, good.replace("[robot]", "[robbot]"), "CEL002"),
            (holes, "nonsense", ""),
        ):
            kept = file.read_text()
            file.write_text(content)
            assert bench.call("reload", {})[0] == 200
            error = bench.settled()["error"]
            assert f"error {code}" in error
            assert error.count("\n") == 0
            assert bench.call("plan")[0] == 200
            file.write_text(kept)
        bench.call("reload", {})
        state = bench.settled()
        assert "error" not in state
        assert state["good"]
        code, said = bench.stop()
        assert code in (0, 130)
        assert "Traceback" not in said
    finally:
        bench.process.kill()


def test_bad_files_at_the_start_are_one_line_and_no_server(tmp_path, capfd):
    cell, holes = job(tmp_path, holes=2)
    (tmp_path / "bad.csv").write_bytes(b"\x00\xff nonsense")
    (tmp_path / "bad.toml").write_text("[robbot]\n")
    for files in (
        ("none.toml", holes),
        ("bad.toml", holes),
        (cell, "none.csv"),
        (cell, "bad.csv"),
        (cell, tmp_path),
    ):
        call = ["ui", *(str(tmp_path / file) for file in files), "--no-browser"]
        assert app.run(call) == 2, files
        out, err = capfd.readouterr()
        assert out == ""
        assert ": error " in err.splitlines()[0]
        assert len(err.splitlines()) <= 2, err


def test_it_ends_at_once_while_it_plans(tmp_path):
    bench = Running(*job(tmp_path, holes=40))
    start = time.monotonic()
    code, said = bench.stop()
    assert code in (0, 130)
    assert time.monotonic() - start < 8.0
    assert "Traceback" not in said


def test_a_cell_alone_is_shown(tmp_path):
    cell, _ = job(tmp_path, holes=1)
    bench = Running(cell)
    try:
        status, page, _ = bench.call("")
        assert status == 200
        assert b"kr500_drilling" in page
        assert bench.call("state")[0] == 404
    finally:
        bench.stop()
