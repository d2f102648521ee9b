"""The version of postproc."""

__version__ = "0.2.0"
