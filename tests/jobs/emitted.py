"""CAM text to the text of the program, and the program's own numbers read by plain patterns."""

import functools
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import postproc as pp
from postproc.jobs.convert import ConvertRequest, convert

CELL = """schema = "postproc.cell/1"
name = "text"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = { xyz_mm = [150, 0, 300], abc_deg = [0, 0, 0] }
axis = "+x"
[workpiece]
frame = { xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }
[optimize]
step_deg = 60
refine = false
[motion]
rapid_percent = 50
[krl.hooks]
tap_reverse = "TAP_BACK"
"""
RAPID = 1.0
"""Path speed [m/s] of straight rapids in this cell: half of the default of 2 m/s."""
_POINT = r"\{X ([-\d.]+),Y ([-\d.]+),Z ([-\d.]+)"
_LINE = re.compile(rf"^LIN {_POINT}[^}}]*\}}( C_DIS)?")
_CIRC = re.compile(rf"^CIRC {_POINT}[^}}]*\}}, ?{_POINT}[^}}]*\}}( C_DIS)?")
_SPEED = re.compile(r"^\$VEL\.CP=([\d.]+)")


@dataclass
class Step:
    """A line of the program: ``LIN``, ``CIRC``, ``PTP``, or a statement as it stands."""

    word: str
    point: np.ndarray | None = None
    aux: np.ndarray | None = None
    speed: float = 0.0
    is_exact: bool = True


def converted(folder, text, name="part.apt", cell=CELL, dialect=None, accept=()):
    """Return the job of a CAM text."""
    (folder / "cell.toml").write_text(cell)
    (folder / name).write_text(text)
    shop = pp.load_cell(folder / "cell.toml")
    part = pp.read(folder / name, shop, dialect=dialect, accept_words=accept)
    return pp.convert(part, shop)


@functools.cache
def _files_of(text, name, cell):
    with tempfile.TemporaryDirectory() as folder:
        cam, place = Path(folder, name), Path(folder, "cell.toml")
        cam.write_text(text)
        place.write_text(cell)
        made = convert(ConvertRequest(str(cam), str(place)))
        assert made.good, made.findings
    return made.name, made.files


def written_program(cam, cell):
    """Write the good program of two files beside them; equal ones are converted once.

    Returns:
        The path of its main file.
    """
    name, files = _files_of(cam.read_text(), cam.name, cell.read_text())
    out = cam.parent / "out"
    out.mkdir(exist_ok=True)
    for file, content in files.items():
        (out / file).write_bytes(content)
    return out / f"{name}.src"


def program(job):
    """Return the text of a good job."""
    assert job.good, [str(finding) for finding in job.findings if finding.severity == "error"]
    return "".join(data.decode() for name, data in job.files.items() if name.endswith(".src"))


def steps(job):
    """Return what the program says after its head, line by line."""
    lines = program(job).split("\r\n")
    start = next(i for i, line in enumerate(lines) if "(MOTION STATE)" in line)
    found, speed = [], 0.0
    for line in lines[start + 1 :]:
        if match := _SPEED.match(line):
            speed = float(match[1])
        elif match := _LINE.match(line):
            point = np.array([float(v) for v in match.groups()[:3]])
            found.append(Step("LIN", point, None, speed, not match[4]))
        elif match := _CIRC.match(line):
            values = [float(v) for v in match.groups()[:6]]
            aux, point = np.array(values[:3]), np.array(values[3:])
            found.append(Step("CIRC", point, aux, speed, not match[7]))
        elif line.startswith("PTP"):
            found.append(Step("PTP"))
        elif line and not line.startswith((";", "BAS(", "$")):
            found.append(Step(line.split(" ;")[0].strip()))
    return found
