"""``python -m tools.controllers lint FOLDER...``, ``verify FOLDER...``, ``mutate FILE [COUNT]``."""

from __future__ import annotations

import sys
from pathlib import Path

from tools.controllers import lint_table, mutate, verify_table


def main(command: str, *arguments: str) -> None:
    """Print what lint finds, what verify says, or what becomes of damaged archives."""
    if command == "lint":
        table = lint_table.table_of(map(Path, arguments))
        print("\n".join(lint_table.lines_of(table)))
        sys.exit(bool(table.false))
    if command == "verify":
        print("\n".join(verify_table.lines_of(verify_table.table_of(map(Path, arguments)))))
        return
    count = int(arguments[1]) if len(arguments) > 1 else 200
    mutate.print_outcomes(Path(arguments[0]), count)


main(*sys.argv[1:])
