"""DELMIA robot tasks as XML."""

from postproc.readers.delmia import reader
