"""The command group: loads a command only when it is called, and turns errors into exit codes."""

from __future__ import annotations

import atexit
import errno
import gc
import importlib
import json
import os
import sys
import traceback
from contextlib import suppress
from typing import NoReturn

import click

from postproc.errors import ExitCode, PostprocError, UsageError
from postproc.version import __version__

# One thread for linear algebra, set before numpy is loaded: sums must not depend on the number
# of cores, the matrices here are small, and parallel work runs in processes.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

# A program of 10,000 holes is 300,000 objects without a cycle: to look through them again and again
# costs a fiftieth of the time. The modules of a command are less than the first look waits for.
gc.set_threshold(500_000, 20, 20)

# Plug-ins of pydantic watch what is validated; to look for them reads a file of every package.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

COMMANDS = {
    "convert": "CAM toolpath to a checked KUKA program.",
    "inspect": "What was read from a CAM file, before any robot.",
    "verify": "Run a program's text on the robot model, against the CAM path.",
    "lint": "What a controller would refuse or silently change.",
    "diff": "Semantic difference of two programs or two folders.",
    "batch": "Convert many inputs, resumable.",
    "sample": "Measuring plan for joint stiffness by space gridding.",
    "identify": "Joint stiffness from measurements.",
    "diagnose": "The sim-to-real gap: where, which effect, how far it shrinks.",
    "predict": "Tool points that the model expects.",
    "place": "The best place of the part, or of the robot, for a job.",
    "fit-base": "The base of a part from measured datum points.",
    "stiffness": "Stiffness index over the rotation about the tool axis.",
    "ui": "A workbench in the browser: see, pin, move, save.",
    "explain": "Cause and remedy of a finding code.",
    "robots": "The built-in robots and where each number is from.",
    "plugins": "Readers, emitters, effects, objectives: name, origin, version.",
    "new-cell": "Write a commented cell.toml.",
    "check": "What is wrong with a cell file.",
}


class _LazyGroup(click.Group):
    """A group whose help needs no import of any command."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"postproc.cli.commands.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=_LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Example: postproc convert part.cls --cell cell.toml -o out",
)
@click.version_option(__version__, "-V", "--version", prog_name="postproc")
def group() -> None:
    """CAM toolpaths to checked KUKA robot programs.

    Exit codes: 0 good, 1 the answer is bad, 2 the input or the call is wrong, 130 interrupted.
    """


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and end the process with the contract's codes.

    The process is not taken apart: to free every module and object one by one takes the interpreter
    a tenth of a second. What was to be done at the end is done, and what was printed is flushed.
    """
    code = run(arguments)
    if sys.gettrace() is None and sys.getprofile() is None:
        atexit._run_exitfuncs()
        with suppress(OSError, ValueError):  # the interpreter's own end says what this is
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:  # closed by whoever called
                    stream.flush()
            os._exit(code)
    sys.exit(code)


def run(arguments: list[str] | None = None) -> int:  # noqa: PLR0911 - one return per kind of end
    """Run the command line and return the exit code; expected trouble prints no traceback."""
    as_json = "--json" in (sys.argv[1:] if arguments is None else arguments)
    try:
        result = group.main(arguments, prog_name="postproc", standalone_mode=False)
    except PostprocError as error:
        return _complain(error, as_json)
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("postproc:1: error CLI130: interrupted, nothing was written", err=True)
        return ExitCode.INTERRUPTED
    except click.ClickException as error:
        return _complain(
            UsageError("CLI001", error.format_message(), hint=_usage_hint(error)), as_json
        )
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.BAD_ANSWER
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            return _bug()
        click.echo("postproc:1: error CLI003: no space left where the output goes", err=True)
        return ExitCode.BAD_INPUT
    except MemoryError:
        return _complain(UsageError("CLI002", "not enough memory for this input"), as_json)
    except Exception:  # noqa: BLE001 - a bug of ours
        return _bug()
    return result if isinstance(result, int) else ExitCode.GOOD


def _bug() -> int:
    """Show a fault of ours whole, and ask for a report."""
    traceback.print_exc()
    click.echo("postproc: this is a bug of postproc, please report the lines above", err=True)
    return ExitCode.INTERNAL


def _complain(error: PostprocError, as_json: bool) -> int:
    """Print an error: a line and its hint on stderr, with ``--json`` also the one object."""
    click.echo(str(error), err=True)
    if error.hint:
        click.echo(f"    hint: {error.hint}", err=True)
    if as_json:
        source = error.source
        document = {
            "schema": "postproc.error/1",
            "ok": False,
            "code": error.code,
            "message": " ".join(error.message.split()),
            "file": source.path if source else None,
            "line": source.line if source else None,
            "hint": error.hint,
        }
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))
    return ExitCode.BAD_INPUT


def _usage_hint(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    return f"see {context.command_path} --help" if context is not None else ""
