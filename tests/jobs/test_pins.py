"""Pins of a side file: kept by every strategy, or an error that names them."""

import json

import numpy as np
import pytest

from postproc.cli import app
from postproc.jobs.convert import ConvertRequest, convert
from postproc.units import DEG

HOLES = "id,x,y,z,i,j,k,depth\n" + "".join(f"H{i},{40 * i},0,0,0,0,1,5\n" for i in range(8))
CUT = (
    "PARTNO/CUT\nUNITS/MM\nFEDRAT/600,MMPM\nRAPID\nGOTO/0,0,50,0,0,1\nGOTO/0,0,0\n"
    + "".join(f"GOTO/{12 * i},0,0\n" for i in range(1, 12))
    + "FINI\n"
)


@pytest.fixture
def job(tmp_path, cell):
    """Return a function: a file name, its text and pins to the request of a conversion."""

    def make(name, text, pins, **keys):
        (tmp_path / name).write_text(text)
        (tmp_path / "pins.csv").write_text("# by hand\ntag,spin_deg\n" + pins)
        source, side = str(tmp_path / name), str(tmp_path / "pins.csv")
        return ConvertRequest(source, str(cell), keys, pins=side)

    return make


def spin_at(conversion, name):
    plan = conversion.plan
    tag = next(t for t in range(len(plan.toolpath)) if plan.toolpath.tag_name(t) == name)
    return plan.spin[plan.tag == tag] / DEG


@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_kept_at_holes(job, strategy):
    found = convert(job("holes.csv", HOLES, "H3,17.5\nH6,-21\n", strategy=strategy))
    assert found.good, found.findings
    assert found.files
    assert np.allclose(spin_at(found, "H3"), 17.5, atol=1e-6)
    assert np.allclose(spin_at(found, "H6"), -21.0, atol=1e-6)
    free = convert(job("holes.csv", HOLES, "H6,-21\n", strategy=strategy))
    assert not np.allclose(spin_at(free, "H3"), 17.5, atol=1.0)


@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_kept_inside_a_cut(job, strategy):
    """Tag 7 lies between key tags; without names a tag is its index from 0."""
    found = convert(job("cut.apt", CUT, "7,12.5\n", strategy=strategy))
    assert found.good, found.findings
    assert np.allclose(spin_at(found, "7"), 12.5, atol=1e-6)


def test_the_file_counts_before_the_cell(job, cell):
    with cell.open("a") as stream:
        stream.write("[optimize.pins]\nH1 = 30.0\nH3 = 30.0\n")
    found = convert(job("holes.csv", HOLES, "H3,17.5\n"))
    assert np.allclose(spin_at(found, "H3"), 17.5, atol=1e-6)
    assert np.allclose(spin_at(found, "H1"), 30.0, atol=1e-6)


def test_a_pin_that_cannot_be_kept_is_named(tmp_path, cell, capsys):
    """A turn that is out of limits at one hole: that tag fails, and the message says the pin."""
    text = cell.read_text().replace("xyz_mm = [1700, 0, 700]", "xyz_mm = [2300, 0, 700]")
    cell.write_text(text)
    (tmp_path / "holes.csv").write_text(HOLES)
    pins, out = tmp_path / "pins.csv", tmp_path / "out"
    call = ["convert", str(tmp_path / "holes.csv"), "--cell", str(cell), "-o", str(out), "--json"]
    assert app.run(call) == 0
    capsys.readouterr()
    failures = []
    for spin in range(-180, 180, 20):
        pins.write_text(f"tag,spin_deg\nH7,{spin}\n")
        code = app.run([*call, "--pins", str(pins)])
        failures = json.loads(capsys.readouterr().out)["failures"]
        assert (code == 1) == bool(failures)
        if failures:
            break
    (failure,) = failures
    assert failure["tag"] == 7
    assert failure["line"] == 9
    assert f"tag H7: {failure['reason'].replace('_', ' ')}" in failure["detail"]
    assert f"pinned to a spin of {spin} deg: none of 8 poses" in failure["detail"]


@pytest.mark.parametrize(
    ("text", "line", "code"),
    [
        ("", 1, "PIN006"),
        ("tag,spin_deg\n", 1, "PIN006"),
        ("name,spin_deg\nH1,3\n", 1, "PIN002"),
        ("# note\n\ntag,spin_deg\nH1,3,4\n", 4, "PIN003"),
        ("tag,spin_deg\n,3\n", 2, "PIN003"),
        ("tag,spin_deg\nH1,three\n", 2, "PIN004"),
        ("tag,spin_deg\nH1,nan\n", 2, "PIN004"),
        ("tag,spin_deg\nH1,361\n", 2, "PIN004"),
        ("tag,spin_deg\nH1,3\nH1,4\n", 3, "PIN005"),
        ("tag,spin_deg\nH1,3\nK1,4\n", 3, "PIN007"),
        ("tag,spin_deg\nH1,\xe9\n".encode("latin-1"), 2, "PIN001"),
    ],
)
def test_wrong_files(tmp_path, cell, capsys, text, line, code):
    (tmp_path / "holes.csv").write_text(HOLES)
    pins, out = tmp_path / "pins.csv", tmp_path / "out"
    pins.write_bytes(text if isinstance(text, bytes) else text.encode())
    call = ["convert", str(tmp_path / "holes.csv"), "--cell", str(cell), "-o", str(out)]
    assert app.run([*call, "--pins", str(pins)]) == 2
    assert capsys.readouterr().err.startswith(f"{pins}:{line}: error {code}: ")
    assert not out.exists()
