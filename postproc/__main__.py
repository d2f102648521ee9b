"""Run the command line as ``python -m postproc``."""

from postproc.cli import main

main()
