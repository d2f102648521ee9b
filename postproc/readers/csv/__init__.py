"""Points and holes as CSV, or as arrays."""

from postproc.readers.csv import reader
from postproc.readers.csv.arrays import holes_of
from postproc.readers.csv.pins import read_pins
