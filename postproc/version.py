"""The version of postproc."""

__version__ = "0.5.0"
