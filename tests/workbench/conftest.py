import http.client
import json
import re
import signal
import subprocess
import sys
import time

import pytest

from tests.browsers import chromium
from tests.places import PANEL, ROOT
from tests.report.conftest import panel_cell

pytest.importorskip("uvicorn")


@pytest.fixture
def browser():
    with chromium() as started:
        yield started


def settled(state, seconds=120.0):
    """Ask for the state until the newest plan is there, and return it."""
    end = time.monotonic() + seconds
    while (found := state())["busy"]:
        assert time.monotonic() < end, found
        time.sleep(0.02)
    return found


def job(folder, holes=12):
    """Write a cell and holes of the panel; return their paths."""
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (folder / "holes.csv").write_text("\n".join([lines[0], *lines[60 : 60 + holes]]) + "\n")
    (folder / "cell.toml").write_text(panel_cell())
    return folder / "cell.toml", folder / "holes.csv"


class Running:
    """A workbench in a process of its own, as a user starts it."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "postproc", "ui", *map(str, arguments), "--no-browser"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        line = self.process.stdout.readline()
        self.address = re.search(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/", line)
        self.port, self.token = int(self.address[1]), self.address[2]

    def call(self, name, content=None, *, method=None, token=None, **headers):
        """Return status and body of a request; ``content`` makes it a POST of the page."""
        method = method or ("GET" if content is None else "POST")
        given = {"Host": f"127.0.0.1:{self.port}"}
        if method == "POST":
            given["Origin"] = f"http://127.0.0.1:{self.port}"
        given |= {key.capitalize(): value for key, value in headers.items()}
        given = {key: value for key, value in given.items() if value}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        body = content if isinstance(content, bytes) else json.dumps(content or {}).encode()
        connection.putrequest(method, f"/{token or self.token}/{name}", skip_host=True)
        for key, value in given.items():
            connection.putheader(key, value)
        if method == "POST":
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders(body if method == "POST" else None)
        answer = connection.getresponse()
        found = answer.status, answer.read(), answer.headers
        connection.close()
        return found

    def state(self):
        return json.loads(self.call("state")[1])

    def settled(self, seconds=120.0):
        """Wait until the newest plan is there, and return the state."""
        return settled(self.state, seconds)

    def stop(self):
        """Interrupt it; return its exit code and what it said."""
        self.process.send_signal(signal.SIGINT)
        said = self.process.communicate(timeout=20)
        return self.process.returncode, "".join(said)


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    started = Running(*job(tmp_path_factory.mktemp("bench")))
    yield started
    started.process.kill()
    started.process.communicate()
