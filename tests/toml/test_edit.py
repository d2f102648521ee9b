"""Changed keys in TOML text: the data change as asked, and no other line does."""

import copy
import tomllib

import pytest

from postproc.errors import DataError
from postproc.toml import edited

TEXT = """\
# head
schema = "x"  # name
workpiece.number = 1
[tool]  # the tool
frame = { xyz_mm = [1, 2, 3], "abc_deg" = [0, 0, 0] }  # of the flange
empty = {}
[tool.cutter]
size = 3
[[bases]]
number = 1
frame.xyz_mm = [ # one
  1,
  2, 3 ]
[[bases]]
number = 2  # two"""
CHANGES = [
    {("schema",): "y"},
    {("tool", "frame", "xyz_mm"): [9.5, 2.0, 3.0]},
    {("tool", "frame"): {"abc_deg": [1, 2, 3]}},
    {("tool", "empty", "a b"): 1},
    {("tool", "cutter", "length"): 7},
    {("tool", "frame", "more"): {"x": 1}},
    {("bases", 0, "frame"): {"xyz_mm": [0, 0, 0], "abc_deg": [1, 1, 1]}},
    {("bases", 1, "frame"): {"xyz_mm": [4, 5, 6]}},
    {("workpiece", "cam"): ["A"]},
    {("optimize", "pins"): {"H1": 30.0}},
    {("name",): "n", ("limits", "clearance_mm"): 2.0},
    {("bases", 1, "number"): 3, ("schema",): "z"},
]


def put(data, location, value):
    there = data
    for part in location[:-1]:
        there = there.setdefault(part, {}) if isinstance(there, dict) else there[part]
    old = there.get(location[-1])
    both = isinstance(value, dict) and isinstance(old, dict)
    there[location[-1]] = {**old, **value} if both else value


@pytest.mark.parametrize("changes", CHANGES, ids=str)
def test_the_keys_change_and_nothing_else(changes):
    expected = copy.deepcopy(tomllib.loads(TEXT))
    for location, value in changes.items():
        put(expected, location, value)
    result = edited(TEXT, changes)
    assert tomllib.loads(result) == expected
    comments = [line.split("#")[1] for line in TEXT.splitlines() if "#" in line]
    lost = [text for text in comments if text not in result]
    assert lost in ([], [" one"])  # a comment inside a list that is written anew
    same = [line for line in TEXT.splitlines() if line in result.splitlines()]
    assert len(same) >= len(TEXT.splitlines()) - 3 * len(changes)


def test_what_has_no_place_is_refused():
    for location in [("schema", "a"), ("bases", 5, "number")]:
        with pytest.raises((DataError, KeyError, IndexError, TypeError, AttributeError)):
            edited(TEXT, {location: 1})
