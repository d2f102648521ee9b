"""The reader of G-code (ISO 6983 as Fanuc and LinuxCNC speak it)."""

from postproc.readers.gcode.reader import GcodeReader
