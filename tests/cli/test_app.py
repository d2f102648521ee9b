import json
import subprocess
import sys
from pathlib import Path

import pytest

from postproc.cell import Strategy
from postproc.cli import app
from postproc.cli.commands import batch, convert


def run(arguments, capsys):
    code = app.run(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_help_loads_no_numbers():
    code = (
        "import sys; from postproc.cli import app; code = app.run(['--help'])\n"
        "heavy = {'numpy', 'scipy', 'trimesh', 'pinocchio', 'coal', 'lxml', 'pydantic', 'rich'}\n"
        "assert code == 0\nassert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.mark.parametrize("command", [batch.command, convert.command])
def test_choices_are_those_of_the_cell(command):
    """The command line names them itself: it must start without the cell."""
    (option,) = (param for param in command.params if param.name == "strategy")
    assert set(option.type.choices) == set(Strategy)


@pytest.mark.parametrize("name", sorted(app.COMMANDS))
def test_every_command_has_help_with_an_example(name, capsys):
    code, out, err = run([name, "--help"], capsys)
    assert code == 0
    assert f"postproc {name}" in out.split("Example", 1)[1]
    assert "--json" in out
    assert "--quiet" in out
    assert err == ""


@pytest.mark.parametrize(
    "arguments",
    [
        ["convrt", "a"],
        ["convert"],
        ["convert", "a.cls", "-o", "x"],
        ["convert", "a.cls", "--cell", "c.toml", "-o", "x", "--format", "step"],
        ["convert", "a.cls", "--cell", "c.toml", "-o", "x", "--nonsense"],
        ["diff", "only_one"],
        ["batch", "-o", "x", "a", "--jobs", "0"],
    ],
)
def test_a_wrong_call_is_one_line_and_exit_2(arguments, capsys):
    code, out, err = run(arguments, capsys)
    assert code == 2
    assert out == ""
    assert err.splitlines()[0].startswith("postproc:1: error CLI001: ")
    assert "Traceback" not in err


def test_an_empty_value_is_refused_as_of_an_unset_variable(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    wrong = []
    for call in ("convert a --cell c -o ''", "lint ''", "fit-base a --cell ''", "sample --name ''"):
        code, _, err = run([word.strip("'") for word in call.split()], capsys)
        if code != 2 or "CLI001" not in err:
            wrong.append(call)
    assert (wrong, list(tmp_path.iterdir())) == ([], [])


def test_a_missing_input_is_named(tmp_path, capsys):
    code, out, err = run(["inspect", str(tmp_path / "none.cls")], capsys)
    assert (code, out) == (2, "")
    assert err.splitlines()[0] == f"{tmp_path / 'none.cls'}:1: error IO001: no such file"


def test_a_bug_shows_itself_and_asks_for_a_report(monkeypatch, capsys):
    def broken(*_args, **_kwargs):
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(app.group, "main", broken)
    code, _, err = run(["robots"], capsys)
    assert code == 70
    assert "ZeroDivisionError: inside" in err
    assert "please report" in err


def test_an_interrupt_is_exit_130(monkeypatch, capsys):
    def stopped(*_args, **_kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(app.group, "main", stopped)
    code, _, err = run(["robots"], capsys)
    assert code == 130
    assert "interrupted" in err


def test_json_is_one_object_and_nothing_else(capsys):
    code, out, _ = run(["robots", "--json"], capsys)
    assert code == 0
    assert isinstance(json.loads(out), dict)


def test_with_json_an_error_is_the_one_object(tmp_path, capsys):
    cell = tmp_path / "cell.toml"
    cell.write_text('schema = "postproc.cell/1"\nnmae = "x"\n')
    code, out, err = run(["check", str(cell), "--json"], capsys)
    document = json.loads(out)
    assert (code, document["schema"], document["ok"]) == (2, "postproc.error/1", False)
    line = f"{document['file']}:{document['line']}: error {document['code']}: {document['message']}"
    assert err.splitlines()[0] == line
    code, out, _ = run(["convert", "--json"], capsys)
    assert (code, json.loads(out)["code"]) == (2, "CLI001")


@pytest.mark.parametrize(("command", "status"), [("robots", 0), ("nothing", 2)])
@pytest.mark.parametrize("wrapped", ["", "import sys; sys.setprofile(lambda *_: None)"])
def test_the_end_of_the_process_loses_nothing(command, status, wrapped):
    code = f"""
import atexit
from postproc.cli import main
atexit.register(print, 'done at the end')
{wrapped}
main(['{command}'])
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == status
    assert done.stdout.endswith("done at the end\n")
    assert ("KR" in done.stdout, "CLI001" in done.stderr) == (status == 0, status == 2)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("arguments", [["robots"], ["plugins", "--json"]])
def test_a_full_device_is_one_line_and_exit_2(arguments):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "postproc", *arguments]
        done = subprocess.run(command, check=False, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "postproc:1: error CLI003: no space left where the output goes\n"
