"""The command line. Each command is one module of ``cli/commands``, imported when it is called."""

from postproc.cli.app import main

__all__ = ["main"]
