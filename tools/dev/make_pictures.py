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
RADIUS = 1800.0
"""Of the skin of the panel [mm]."""


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


def stiffened(folder: Path) -> Path:
    """Return the cell of the panel with stringers and frames behind its skin, as a fuselage has."""

    def solid(name: str, size: tuple[float, ...], x: float, angle: float, depth: float) -> str:
        y, z = (RADIUS - depth) * np.sin(angle), (RADIUS - depth) * np.cos(angle) - RADIUS
        place = f"xyz_mm = [{x:.0f}, {y:.1f}, {z:.1f}], abc_deg = [0, 0, {-np.degrees(angle):.2f}]"
        return f'{{ name = "{name}", box = {{ size_mm = {list(size)} }}, {place} }}'

    angles = np.linspace(-0.18, 0.18, 7)
    solids = [solid(f"stringer {k}", (1160, 4, 34), 0, a, 24) for k, a in enumerate(angles)]
    solids += [solid(f"flange {k}", (1160, 22, 3), 0, a, 41) for k, a in enumerate(angles)]
    solids += [
        solid(f"frame {x} {k}", (4, 112, 70), x, a, 82)
        for x in (-480, -160, 160, 480)
        for k, a in enumerate((angles[1:] + angles[:-1]) / 2)
    ]
    text = (PANEL / "cell.toml").read_text(encoding="utf-8")
    text = text.replace('{ file = "panel.stl" }', '{ file = "panel.stl" }, ' + ", ".join(solids))
    path = folder / "cell.toml"
    path.write_text(text.replace('file = "', f'file = "{PANEL.as_posix()}/'), encoding="utf-8")
    return path


def pages(folder: Path) -> dict[str, Path]:
    """Make both pages in a folder."""
    cell = ["--cell", str(stiffened(folder)), "-q"]
    program = folder / "program.html"
    call = ["convert", str(PANEL / "panel.csv"), *cell, "-o", str(folder), "--report", str(program)]
    if app.run(call) != 0:
        raise SystemExit("the panel could not be converted")
    rows = folder / "measured.csv"
    rows.write_text(campaign(), encoding="utf-8")
    twin = ["--cell", str(ROOT / "fixtures" / "drift_campaign" / "cell.toml"), "-q"]
    if app.run(["diagnose", str(rows), *twin, "-o", str(folder / "gap")]) != 0:
        raise SystemExit("the campaign could not be diagnosed")
    return {"program_page": program, "diagnosis_page": folder / "gap" / "report.html"}


def workbench(browser: Browser, cell: Path) -> bytes:
    """Return a picture of the workbench while a spin is dragged."""
    call = [sys.executable, "-m", "postproc", "ui", str(cell), "panel.csv"]
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
            (target / "workbench.png").write_bytes(workbench(browser, Path(folder) / "cell.toml"))
    finally:
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures")
