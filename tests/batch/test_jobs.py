import os

import pytest

from postproc.batch.jobs import (
    Overrides,
    find_inputs,
    is_input,
    load_overrides,
    make_jobs,
    uniquely_named,
)
from postproc.errors import DataError
from postproc.jobs.convert import ConvertRequest

BASE = ConvertRequest(source="", cell="cell.toml")


def test_folders_globs_and_lists_give_each_input_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.cls", "b.ncl.8", "c.csv", "notes.txt", "sub/d.APT"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
    (tmp_path / "list.txt").write_text("# mine\nc.csv\n*.cls\n")
    everything = ["a.cls", "b.ncl.8", "c.csv", "sub/d.APT"]
    assert find_inputs(["."]) == everything
    assert find_inputs(["@list.txt"]) == ["c.csv", "a.cls"]
    assert find_inputs(["a.cls", "*.cls"]) == ["a.cls"]


def test_a_pattern_without_a_match_is_an_error():
    with pytest.raises(DataError, match="BAT001"):
        find_inputs(["nothing/*.cls"])


@pytest.mark.parametrize(
    ("name", "yes"),
    [("x.ncl.12", True), ("x.CLS", True), ("x.src", False), ("x.8", False), ("csv", False)],
)
def test_what_counts_as_an_input(tmp_path, name, yes):
    assert is_input(tmp_path / name) is yes


def named(sources, recorded=None):
    return uniquely_named(make_jobs(sources, BASE, Overrides({})), recorded or {})


def test_a_name_that_was_given_stays_while_another_input_has_the_plain_one():
    both = {job.key: job.request.name for job in named(["x/part.csv", "y/part.csv"])}
    assert both["x/part.csv"] == "part"
    (again,) = named(["y/part.csv"], both)
    assert again.request.name == both["y/part.csv"]
    (alone,) = named(["y/part.csv"], {"y/part.csv": both["y/part.csv"]})
    assert alone.request.name == "part"


def test_names_are_unique_and_do_not_depend_on_later_inputs():
    some = named(["p/part-1.cls", "q/part 1.apt"])
    more = named(["p/part-1.cls", "q/part 1.apt", "r/part_1.csv"])
    names = [job.request.name for job in more]
    assert len({name.upper() for name in names}) == 3
    assert [job.request.name for job in some] == names[:2]
    assert all(len(name) <= 24 for name in names)


def test_overrides_apply_in_order(tmp_path):
    path = tmp_path / "batch.toml"
    path.write_text(
        'schema = "postproc.batch/1"\n[defaults]\nunits = "mm"\n'
        '[[input]]\nmatch = "*.csv"\nstrategy = "each"\ncell = "other.toml"\n'
    )
    overrides = load_overrides(str(path))
    csv = overrides.request("holes/a.csv", BASE)
    assert csv.keys == {"units": "mm", "strategy": "each"}
    assert csv.cell == str(tmp_path / "other.toml")
    assert overrides.request("a.cls", BASE).keys == {"units": "mm"}


def test_rules_match_the_end_of_a_path(tmp_path):
    path = tmp_path / "batch.toml"
    path.write_text('[[input]]\nmatch = "left/*.csv"\nname = "LEFT"\n')
    overrides = load_overrides(str(path))
    assert overrides.request("wing/left/a.csv", BASE).name == "LEFT"
    assert overrides.request("wing/right/a.csv", BASE).name is None
    assert overrides.unused(["wing/right/a.csv"]) == ["left/*.csv"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("x = [", 1),
        ("\ntypo = 1\n", 2),
        ("input = 3\n", 1),
        ("defaults = 3\n", 1),
        ('[[input]]\ncell = "a"\n', 1),
        ('[[input]]\nmatch = "a"\n[[input]]\nmatch = 3\n', 3),
        ("[defaults]\nrecover = 3\n", 2),
        ("[defaults]\n\nfoo = 'x'\n", 3),
        ("[defaults]\nformat = 'step'\n", 2),
        ("[defaults]\nfeed_units = 'ft'\n", 2),
    ],
)
def test_a_wrong_batch_file_is_one_error_with_its_line(tmp_path, text, line):
    path = tmp_path / "batch.toml"
    path.write_text(text)
    with pytest.raises(DataError, match=f"batch.toml:{line}: error BAT00"):
        load_overrides(str(path))


def test_what_is_no_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("endless.csv")
    with pytest.raises(DataError, match=r"endless\.csv:1: error BAT001: neither"):
        find_inputs(["endless.csv"])
    (tmp_path / "list.txt").write_text("@list.txt\n")
    with pytest.raises(DataError, match="BAT006: this list names itself"):
        find_inputs(["@list.txt"])


def test_one_file_by_two_spellings_is_one_input(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("")
    assert find_inputs(["./a.csv", "a.csv", str(tmp_path / "a.csv")]) == ["a.csv"]
