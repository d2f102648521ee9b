"""The version of postproc."""

__version__ = "0.7.0"
