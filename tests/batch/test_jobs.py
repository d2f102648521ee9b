import pytest

from postproc.batch.jobs import Overrides, find_inputs, is_input, load_overrides, make_jobs
from postproc.errors import DataError
from postproc.pipeline.convert import ConvertRequest

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


def test_names_are_unique_and_do_not_depend_on_later_inputs():
    some = make_jobs(["p/part-1.cls", "q/part 1.apt"], BASE, Overrides({}))
    more = make_jobs(["p/part-1.cls", "q/part 1.apt", "r/part_1.csv"], BASE, Overrides({}))
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
    assert (csv.units, csv.strategy, csv.cell) == ("mm", "each", str(tmp_path / "other.toml"))
    assert overrides.request("a.cls", BASE).strategy is None


@pytest.mark.parametrize(
    "text",
    [
        "x = [",
        "typo = 1\n",
        '[[input]]\ncell = "a"\n',
        "[defaults]\nrecover = 3\n",
        "[defaults]\nfoo = 'x'\n",
    ],
)
def test_a_wrong_batch_file_is_one_error(tmp_path, text):
    path = tmp_path / "batch.toml"
    path.write_text(text)
    with pytest.raises(DataError, match="BAT00"):
        load_overrides(str(path))
