"""A table to fill in: what to drive stands in it, what to read is left empty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from postproc.arrays import FloatArray


def cells(names: Sequence[str], values: FloatArray, digits: int) -> dict[str, str]:
    """Return the cells of numbers (k,) under their names; -0 is 0."""
    return {name: f"{v:z.{digits}f}" for name, v in zip(names, values, strict=True)}


def table_to_fill_in(notes: Sequence[str], rows: Sequence[Mapping[str, str]]) -> bytes:
    """Return the CSV of rows with the same columns, below notes as comment lines."""
    lines = [
        *(f"# {note}" for note in notes),
        ",".join(rows[0]),
        *(",".join(row.values()) for row in rows),
    ]
    return ("\n".join(lines) + "\n").encode()
