"""Makes the pictures of the README: pages of a program and of a diagnosis, the workbench.

    python -m tools.dev.make_pictures [FOLDER]

Needs an installed Chromium.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from postproc.cli import app
from tools.dev.browser import Browser, installed
from tools.dev.hidden_twin import Twin

ROOT = Path(__file__).resolve().parents[2]
PANEL = ROOT / "fixtures" / "drilling_panel"
READY = "window.ppPage && ppPage.state().ready"
MOST_BYTES = 400_000


def campaign(rows: int = 160, seed: int = 3, noise: float = 15e-6) -> str:
    """Return measurements of a made-up KR 500 whose joints give way under load, as CSV text."""
    rng = np.random.default_rng(seed)
    twin = Twin()
    low, high = np.radians([-30, -80, 70, -90, -80, -90]), np.radians([30, -40, 120, 90, -20, 90])
    q = np.repeat(rng.uniform(low, high, (rows // 4, 6)), 4, axis=0)
    force = rng.normal(size=(len(q), 3))
    force *= rng.uniform(300.0, 1500.0, (len(q), 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    force[::4] = 0.0
    q = np.radians(np.round(np.degrees(q), 5))
    points = twin.loaded_point(q, force, twin.tcp) + rng.normal(0.0, noise, (len(q), 3))
    names = ["id", *(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    names += ["fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"]
    lines = [",".join(names)]
    for row in range(len(q)):
        values = [f"{v:.5f}" for v in np.degrees(q[row])] + [f"{v * 1e3:.4f}" for v in points[row]]
        values += [f"{v:.2f}" for v in force[row]] + ["0", "0", "0"]
        lines.append(",".join([f"R{row + 1:03d}", *values]))
    return "\n".join(lines) + "\n"


def pages(folder: Path) -> dict[str, Path]:
    """Make both pages in a folder."""
    cell = ["--cell", str(PANEL / "cell.toml"), "-q"]
    program = folder / "program.html"
    call = ["convert", str(PANEL / "panel.csv"), *cell, "-o", str(folder), "--report", str(program)]
    if app.run(call) != 0:
        raise SystemExit("the panel could not be converted")
    rows = folder / "measured.csv"
    rows.write_text(campaign(), encoding="utf-8")
    if app.run(["diagnose", str(rows), *cell, "-o", str(folder / "gap")]) != 0:
        raise SystemExit("the campaign could not be diagnosed")
    return {"program_page": program, "diagnosis_page": folder / "gap" / "report.html"}


def workbench(browser: Browser) -> bytes:
    """Return a picture of the workbench while a spin is dragged."""
    call = [sys.executable, "-m", "postproc", "ui", "cell.toml", "panel.csv"]
    server = subprocess.Popen(
        [*call, "--no-browser", "--json"], cwd=PANEL, stdout=subprocess.PIPE, text=True
    )
    if server.stdout is None:
        raise SystemExit("the workbench says nothing")
    try:
        said = "".join(server.stdout.readline() for _ in range(4))
        browser.size(1366, 1200)
        browser.call("Page.navigate", url=json.loads(said)["address"])
        browser.wait("window.ppBench && ppBench.state().mapped", 120)
        x, y = browser.run("ppBench.place(50, 60)")
        steps = (("mouseMoved", x, y + 40.0 - 5 * k) for k in range(9))
        browser.mouse(("mousePressed", x, y + 60.0), *steps)
        browser.run("new Promise(done => setTimeout(done, 1500))")
        return browser.picture((0, 0, 1366, 1380))
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(20)


def main(target: Path) -> None:
    """Write the pictures."""
    command = installed()
    if command is None:
        raise SystemExit("no Chromium is installed")
    target.mkdir(parents=True, exist_ok=True)
    browser = Browser(command)
    try:
        with tempfile.TemporaryDirectory() as folder:
            for name, page in pages(Path(folder)).items():
                browser.size(1366, 1000)
                browser.open(page, READY)
                if name == "program_page":
                    browser.run("ppPage.select(107)")
                browser.run("new Promise(done => setTimeout(done, 1500))")
                picture = browser.picture()
                if len(picture) > MOST_BYTES:
                    raise SystemExit(f"{name}: {len(picture)} bytes are too many")
                (target / f"{name}.png").write_bytes(picture)
                print(f"{target / name}.png: {len(picture)} bytes")
        (target / "workbench.png").write_bytes(workbench(browser))
    finally:
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures")
