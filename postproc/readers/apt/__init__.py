"""APT/CL of the CAM systems."""

from postproc.readers.apt import reader
