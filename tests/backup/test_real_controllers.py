"""Backups of real controllers: the numbers of the cell are those that stand in the files.

What stands there is read here by patterns alone, without our reader of KRL.
"""

import json
import re
import tomllib
from pathlib import Path

import pytest

from postproc.backup import read_backup
from postproc.cell import load_cell
from postproc.cli import app
from postproc.errors import ReadError
from postproc.units import DEG, MM
from tests.places import snapshot

ARMS = {
    "HugoDanielson/ChinaMilling": ("KRC", "kuka_kr210_r2700_2"),
    "Aleynikovich/errekaSmartPal": ("KRC", "kuka_kr125_3"),
    "Aleynikovich/Zinkerreka": ("KRC", "kuka_kr210_r2700_prime"),
    "Naqiu06/KUKA-Robotics": ("KRC", "kuka_kr6_r900_sixx"),
    "rawpython/kukaKRLmagic": ("", "kuka_kr120_r2700_2"),
    "khrzysio/KRC4_test": ("", "kuka_kr120_r2700_extra_ha"),
}
NUMBER = r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?"


def text_of(folder, *tail):
    wanted = [part.lower() for part in tail]
    found = [
        path
        for path in folder.rglob("*")
        if [part.lower() for part in path.parts[-len(wanted) :]] == wanted
    ]
    assert len(found) == 1
    return found[0].read_bytes().decode("latin-1")


def scalar(text, name):
    return float(re.search(rf"^[^;\n]*{re.escape(name)}\s*=\s*({NUMBER})", text, re.M | re.I)[1])


def structure(text, name, keys):
    """Components of a structure, None where the file does not assign it."""
    found = re.search(rf"^[^;\n]*{re.escape(name)}\s*=\s*\{{([^\n]*)", text, re.M | re.I)
    if found is None:
        return None
    values = [re.search(rf"\b{key}\s+({NUMBER})", found[1], re.I) for key in keys.split()]
    return [float(value[1]) for value in values]


def frames(text, name):
    numbers = sorted({int(n) for n in re.findall(rf"{name}_DATA\[(\d+)\]\s*=", text, re.I)})
    found = {n: structure(text, f"{name}_DATA[{n}]", "X Y Z A B C") for n in numbers}
    kinds = {n: re.search(rf"{name}_TYPE\[{n}\]\s*=\s*#\s*(\w+)", text, re.I) for n in numbers}
    return {
        n: frame
        for n, frame in found.items()
        if any(frame) and not (kinds[n] and kinds[n][1].upper() == "TCP")
    }


@pytest.fixture(params=ARMS)
def made(request, tmp_path, capsys):
    """Name of the arm, folder R1, the cell, its table, and the path of the backup."""
    folder = snapshot(request.param)
    inside, arm = ARMS[request.param]
    path = tmp_path / "cell.toml"
    assert app.run(["new-cell", "--backup", str(folder), "-o", str(path)]) == 0
    capsys.readouterr()
    return arm, folder / inside / "R1", load_cell(path), tomllib.loads(path.read_text()), folder


def test_the_cell_of_a_real_controller_says_what_its_files_say(made, capsys):
    arm, r1, cell, table, folder = made
    machine, config = text_of(r1, "Mada", "$machine.dat"), text_of(r1, "System", "$config.dat")
    assert cell.robot.name == arm
    geometry = cell.robot.geometry
    elbow = structure(machine, "$TX3P3", "X Z")
    wanted = {
        "a1": scalar(machine, "$LENGTH_A"), "c2": scalar(machine, "$LENGTH_B"),
        "c1": structure(machine, "$TIRORO", "Z")[0], "c4": structure(machine, "$TFLWP", "Z")[0],
        "c3": elbow[0], "a2": -elbow[1],
    }  # fmt: skip
    for key, value in wanted.items():
        assert abs(getattr(geometry, key) / MM - value) < 1e-3
    for axis in range(6):
        low = scalar(machine, f"$SOFTN_END[{axis + 1}]")
        high = scalar(machine, f"$SOFTP_END[{axis + 1}]")
        assert cell.robot.q_min[axis] / DEG >= low - 1e-9
        assert cell.robot.q_max[axis] / DEG <= high + 1e-9
    for key, name in (("tools", "TOOL"), ("bases", "BASE")):
        entries = {entry["number"]: entry["frame"] for entry in table.get(key, [])}
        for number, frame in frames(config, name).items():
            said = [*entries[number]["xyz_mm"], *entries[number]["abc_deg"]]
            assert said == frame, (name, number)  # the very digits: $ROBROOT is zero in all
    for tool in table.get("tools", []):
        mass = structure(config, f"LOAD_DATA[{tool['number']}]", "M")
        assert tool.get("mass_kg") == (mass[0] if mass and mass[0] >= 0.0 else None)
    home = structure(config, "XHOME", "A1 A2 A3 A4 A5 A6")
    if "home_deg" in table.get("motion", {}):
        assert table["motion"]["home_deg"] == home
    code = app.run(["check", str(cell.path), "--backup", str(folder), "--json"])
    assert (code, json.loads(capsys.readouterr().out)["backup"]["differences"]) == (0, [])


def test_every_number_that_is_wrong_shows(made, capsys):
    """A tool and a base moved by a thousandth more than the tolerance."""
    _, _, cell, table, folder = made
    if not table.get("tools") or not table.get("bases"):
        pytest.skip("no tool or no base is used on this controller")
    path = Path(cell.path)
    text = path.read_text()
    z = table["tools"][0]["frame"]["xyz_mm"][2]
    x = table["bases"][-1]["frame"]["xyz_mm"][0]
    changed = text.replace(f", {z!r}]", f", {z + 0.002!r}]", 1)
    head, _, tail = changed.rpartition(f"[{x!r}, ")
    path.write_text(f"{head}[{x + 0.002!r}, {tail}")
    assert app.run(["check", str(cell.path), "--backup", str(folder), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    keys = {difference["key"] for difference in document["backup"]["differences"]}
    tool, base = table["tools"][0]["number"], table["bases"][-1]["number"]
    assert keys == {f"tools[{tool}].frame", f"bases[{base}].frame"}


def test_a_palletiser_with_a_fixed_axis_is_refused():
    with pytest.raises(ReadError, match=r"BAK007.*\$DEF_A4FIX"):
        read_backup(snapshot("luciagumbau228/TFG"))
