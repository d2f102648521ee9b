"""The version of postproc."""

__version__ = "0.4.0"
