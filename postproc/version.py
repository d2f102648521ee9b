"""The version of postproc."""

__version__ = "0.9.0"
