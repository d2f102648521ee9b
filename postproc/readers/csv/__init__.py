"""Points and holes as CSV."""

from postproc.readers.csv import reader
from postproc.readers.csv.pins import read_pins

__all__ = [
    "read_pins",
    "reader",
]
