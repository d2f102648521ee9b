"""FreeCAD CAM post processor that hands a job's toolpath to postproc and gets KUKA KRL back.

Choose ``postproc_krl`` as the job's post processor, with the arguments ``--cell=/path/cell.toml``.
The job's toolpath becomes an APT/CL file beside the output file of the job, postproc converts it
with all its checks, and NAME.src and NAME.dat appear there. FreeCAD's coordinates are the cell's
workpiece frame; a base of the cell claims a work offset of the job by ``cam = ["54"]``, a tool its
number or its name. postproc may live in a Python of its own: name its command by ``--postproc=`` or
by the environment variable POSTPROC when it is not on the PATH.

FreeCAD 1.0 and newer find the class ``Postproc_Krl``, older ones the function ``export``. Only
FreeCAD and the standard library are used.
"""

# ruff: noqa: ANN001, ANN201, ANN202, ANN204 - FreeCAD's objects have no types

import argparse
import math
import os
import pathlib
import re
import shlex
import subprocess

try:
    from Path.Post.Processor import PostProcessor as _Base
except ImportError:  # before FreeCAD 1.0
    _Base = object

TOOLTIP = "KUKA KRL by postproc: checked for reach, limits, singularities and collisions."
TOOLTIP_ARGS = """Arguments:
    --cell=FILE       the robot cell (cell.toml), required
    --postproc=CMD    command of postproc, default: the environment variable POSTPROC, else postproc
    --report=FILE     write a page that shows the program
    --strategy=NAME   smooth, each or global
    --no-convert      write the APT/CL file only
"""
UNITS = "G21"
MACHINE_NAME = "KUKA KRC, by postproc"

SIXTY = 60.0
"""FreeCAD's feeds are mm/s, those of APT mm/min."""
SMALL = 1e-6
PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
CENTRES = ("I", "J", "K")
SPINDLE = {"M3": "CLW", "M03": "CLW", "M4": "CCLW", "M04": "CCLW"}
SILENT = {*("G21", "G40", "G43", "G49", "G80", "G90", "G94"), *("M2", "M02", "M30")}
OFFSETS = re.compile(r"G(5[4-9](?:\.\d+)?)")
LONGEST = 24
"""Characters of the name of a KRL program."""
FLAT = {"G0": "G00", "G1": "G01", "G2": "G02", "G3": "G03"}


class PostError(Exception):
    """The job holds something that cannot be handed on, or postproc refused it."""


class Postproc_Krl(_Base):  # noqa: N801 - FreeCAD's factory makes this name of the file's
    """What FreeCAD 1.0 and newer find: a job, split as it says, to programs beside its output."""

    def __init__(self, job):
        if _Base is object:
            raise PostError("this class is for FreeCAD 1.0 and newer")
        super().__init__(job, tooltip=TOOLTIP, tooltipargs=TOOLTIP_ARGS, units="Metric")

    def export(self):
        """Write the programs of all parts of the job, and return them where FreeCAD may write."""
        from Path.Post.Utils import FilenameGenerator

        names = FilenameGenerator(job=self._job)
        generated = names.generate_filenames()
        parts, whole = [], True
        for part, items in self._buildPostList():
            names.set_subpartname("" if part == "allitems" else part)
            name = next(generated)
            text = export(_with_tool(items), name, self._job.PostProcessorArgs)
            parts.append((part, text))
            whole = whole and pathlib.Path(name) == program_file(name)
        # FreeCAD writes what it gets into its own files: only where they are the programs' own
        return parts if whole else []

    @property
    def tooltip(self):
        """What it does, in a line."""
        return TOOLTIP

    @property
    def tooltipArgs(self):
        """What the arguments are."""
        return TOOLTIP_ARGS


def _with_tool(items):
    """Return the objects of a part of a job behind their tool, as a whole job begins."""
    of_tools = [item for item in items if hasattr(item, "ToolNumber")]
    used = [getattr(item, "ToolController", None) for item in items]
    first = next((tool for tool in used if tool is not None), None)
    return [first, *items] if first is not None and first not in of_tools else list(items)


def program_file(filename):
    """Return the file of the program for an output file of FreeCAD: its name is one of KRL."""
    target = pathlib.Path(filename) if filename not in ("", "-") else _asked_file()
    name = re.sub(r"\W", "_", target.stem, flags=re.ASCII)[:LONGEST]
    name = name if name[:1].isalpha() or name[:1] == "_" else f"P{name}"[:LONGEST]
    return target.with_name(name + ".src")


def _asked_file():
    """Return a file beside the open document, for a FreeCAD that gives no name."""
    import FreeCAD

    document = pathlib.Path(FreeCAD.ActiveDocument.FileName or "job")
    return document.with_suffix(".src")


def export(objectslist, filename, argstring):
    """Write NAME.src and NAME.dat beside ``filename`` and return the program text.

    FreeCAD calls this with the objects of a job in the order in which they are machined.
    """
    arguments = _arguments(argstring)
    target = program_file(filename)
    apt = target.with_suffix(".apt")
    apt.write_text(apt_of(objectslist, target.stem), encoding="ascii", errors="replace")
    if arguments.no_convert:
        return apt.read_text(encoding="ascii")
    _convert(apt, target, arguments)
    _say(f"postproc wrote {target}")
    text = target.read_bytes().decode("latin-1")
    return text.replace("\r\n", "\n") if os.linesep == "\r\n" else text


def _arguments(argstring):
    parser = argparse.ArgumentParser(prog="postproc_krl", add_help=False, allow_abbrev=False)
    parser.add_argument("--cell", default="")
    parser.add_argument("--postproc", default=os.environ.get("POSTPROC", "postproc"))
    parser.add_argument("--report", default="")
    parser.add_argument("--strategy", default="")
    parser.add_argument("--no-convert", action="store_true")
    known, unknown = parser.parse_known_args(shlex.split(argstring or ""))
    if unknown:
        raise PostError(f"unknown argument {unknown[0]}\n{TOOLTIP_ARGS}")
    if not known.cell and not known.no_convert:
        raise PostError("no cell: write --cell=/path/cell.toml into the job's arguments")
    return known


def _convert(apt, target, arguments):
    """Run postproc; on failure say what it said and raise."""
    command = [
        *shlex.split(arguments.postproc),
        *("convert", str(apt), "--format", "apt", "--dialect", "apt", "--cell", arguments.cell),
        *("-o", str(target.parent), "--name", target.stem),
    ]
    for name in ("report", "strategy"):
        if getattr(arguments, name):
            command += ["--" + name, getattr(arguments, name)]
    # FreeCAD's own Python settings must not reach postproc's Python
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    try:
        done = subprocess.run(command, capture_output=True, text=True, env=clean, check=False)
    except OSError as problem:
        raise PostError(
            f"postproc cannot be started ({problem}): name it by --postproc="
        ) from problem
    for line in (done.stderr + done.stdout).splitlines():
        _say(line)
    if done.returncode:
        raise PostError(f"postproc refused the job:\n{done.stderr.strip() or done.stdout.strip()}")


def _say(text):
    try:
        import FreeCAD
    except ImportError:
        return
    FreeCAD.Console.PrintMessage(text + "\n")


def apt_of(objectslist, name):
    """Return the toolpath of FreeCAD objects as APT/CL text."""
    writer = _AptWriter(name)
    for item in objectslist:
        _add(writer, item)
    return writer.text()


def _add(writer, item):
    for child in getattr(item, "Group", None) or []:
        _add(writer, child)
    if not hasattr(item, "Path") or not getattr(item, "Active", True):
        return
    commands = _path_of(item).Commands
    if any(command.Name.upper() in MOTIONS for command in commands):
        controller = getattr(item, "ToolController", None)
        writer.operation(getattr(item, "Label", ""), getattr(controller, "Label", ""))
    for command in commands:
        writer.command(command.Name, dict(command.Parameters))


def _path_of(item):
    """Return an object's path where its placement puts it."""
    try:
        from PathScripts import PathUtils
    except ImportError:
        try:
            import Path.Base.Util as PathUtils
        except ImportError:
            return item.Path
    placed = getattr(PathUtils, "getPathWithPlacement", None)
    return placed(item) if placed is not None else item.Path


class _AptWriter:
    """Turns G-code commands into APT statements; keeps what G-code says only once."""

    def __init__(self, name):
        self.lines = [f"PARTNO/{_plain(name)}", "UNITS/MM"]
        self.place = [0.0, 0.0, 0.0]
        self.is_known = [False, False, False]
        self.plane = "G17"
        self.feed = None
        self.written_feed = None
        self.initial = None
        self.returns_high = True
        self.cycle = None
        self.is_on = [False, False]
        """Spindle and coolant, which the end of the job stops."""

    def text(self):
        """Return the file."""
        self._end_cycle()
        ends = [line for is_on, line in zip(self.is_on, ENDS, strict=True) if is_on]
        return "\n".join([*self.lines, *ends, "FINI"]) + "\n"

    def operation(self, label, tool):
        """Begin an operation, with the tool of its tool controller."""
        self._end_cycle()
        names = [_plain(name).replace(",", " ") for name in (label, tool) if name]
        self.lines.append("TOOL PATH/" + ",TOOL,".join(names or ["job"]))

    def command(self, name, words):
        """Take one command."""
        name = FLAT.get(name.upper(), name.upper())
        if not name or name.startswith("("):
            return
        self._refuse(name, words)
        if "F" in words and words["F"] > 0.0:
            self.feed = words["F"] * SIXTY
        if name in ("G00", "G01", "G02", "G03"):
            self._end_cycle()
            self._motion(name, words)
        elif name in DRILLS:
            self._drill(name, words)
        elif name in ("G98", "G99"):
            self.returns_high = name == "G98"
            self.initial = None
        elif name in PLANES:
            self.plane = name
        else:
            self._other(name, words)

    def _refuse(self, name, words):
        turned = [a for a in "ABC" if abs(words.get(a, 0.0)) > SMALL]
        if turned:
            raise PostError(
                f"{name}: rotary axis {turned[0]}: the robot has no such axis; model the setup "
                "turned, or use the CAM system's APT output"
            )
        if name in ("G20", "G91", "G93", "G95", "G41", "G42") or name.startswith("G38"):
            raise PostError(f"{name} cannot be handed to postproc")

    def _other(self, name, words):
        if name in ("M6", "M06"):
            self._end_cycle()
            self.lines.append("LOADTL/{}".format(int(words.get("T", 0))))
        elif OFFSETS.fullmatch(name):
            self.lines.append("ZERO/" + name[1:])
        elif name in SPINDLE:
            self.is_on[0] = True
            self.lines.append(
                "SPINDL/RPM,{},{}".format(_number(words.get("S", 0.0)), SPINDLE[name])
            )
        elif name in ("M5", "M05"):
            self.is_on[0] = False
            self.lines.append("SPINDL/OFF")
        elif name in ("M7", "M07", "M8", "M08"):
            self.is_on[1] = True
            self.lines.append("COOLNT/{}".format("MIST" if name in ("M7", "M07") else "FLOOD"))
        elif name in ("M9", "M09"):
            self.is_on[1] = False
            self.lines.append("COOLNT/OFF")
        elif name in ("M0", "M00", "M1", "M01"):
            self.lines.append("STOP" if name in ("M0", "M00") else "OPSTOP")
        elif name in ("G4", "G04"):
            self.lines.append("DELAY/{}".format(_number(words.get("P", 0.0))))
        elif name not in SILENT:
            raise PostError(f"{name} is not known to this post processor")

    def _target(self, words):
        end = [words.get(axis, now) for axis, now in zip("XYZ", self.place, strict=True)]
        known = [axis in words or k for axis, k in zip("XYZ", self.is_known, strict=True)]
        return end, known

    def _motion(self, name, words):
        end, known = self._target(words)
        if name in ("G02", "G03"):
            self._arc(name, words, end)
        moves = end != self.place or known != self.is_known
        self.place, self.is_known = end, known
        if not moves and name in ("G00", "G01"):
            return
        if not all(known):
            # the first rapids of an operation name one axis at a time: no point yet
            return
        if name == "G00":
            self.lines.append("RAPID")
        else:
            self._write_feed(name)
        self.lines.append(_goto(end))

    def _write_feed(self, name):
        if self.feed is None:
            raise PostError(f"{name} without a feed: give the tool controller feed rates")
        if self.feed != self.written_feed:
            self.lines.append(f"FEDRAT/{_number(self.feed)},MMPM")
            self.written_feed = self.feed

    def _arc(self, name, words, end):
        first, second, normal = PLANES[self.plane]
        centre = [p + words.get(w, 0.0) for p, w in zip(self.place, CENTRES, strict=True)]
        centre[normal] = self.place[normal]
        start = self.place
        radius = math.hypot(start[first] - centre[first], start[second] - centre[second])
        if radius < SMALL:
            raise PostError(f"{name} without a radius")
        self._write_feed(name)
        axis = [0.0, 0.0, 0.0]
        axis[normal] = 1.0 if name == "G03" else -1.0
        numbers = ",".join(_number(v) for v in [*centre, *axis, radius])
        self.lines.append(f"CIRCLE/{numbers}")

    def _drill(self, name, words):
        end, known = self._target(words)
        top = words.get("R", self.cycle["R"] if self.cycle else self.place[2])
        if self.initial is None or self.cycle is None:
            self.initial = max(self.place[2], top) if self.is_known[2] else top
        bottom = words.get("Z", self.cycle["Z"] if self.cycle else None)
        if bottom is None or bottom > top:
            raise PostError(f"{name}: the bottom of the hole is not below R")
        cycle = {"name": name, "R": top, "Z": bottom}
        cycle["P"] = words.get("P", self.cycle["P"] if self.cycle else 0.0)
        cycle["Q"] = words.get("Q", self.cycle["Q"] if self.cycle else 0.0)
        cycle["F"] = self.feed
        cycle["up"] = self.initial - top if self.returns_high else 0.0
        if cycle != self.cycle:
            if self.feed is None:
                raise PostError(f"{name} without a feed")
            self.lines.append(_cycle_text(cycle))
            self.cycle = cycle
        self.lines.append(_goto([end[0], end[1], top]))
        self.place = [end[0], end[1], top + cycle["up"]]
        self.is_known = [known[0], known[1], True]

    def _end_cycle(self):
        if self.cycle is not None:
            self.lines.append("CYCLE/OFF")
            self.cycle = None


ENDS = ("SPINDL/OFF", "COOLNT/OFF")
DRILLS = {"G81": "DRILL", "G82": "DRILL", "G83": "DEEP", "G73": "BRKCHP", "G85": "BORE"}
MOTIONS = {"G0", "G00", "G1", "G01", "G2", "G02", "G3", "G03", *DRILLS}


def _cycle_text(cycle):
    """Return a CYCLE statement; heights count from R, where the feed starts."""
    parts = ["CYCLE/" + DRILLS[cycle["name"]]]
    parts += ["DEPTH", _number(cycle["R"] - cycle["Z"]), "RAPTO", "0"]
    parts += ["RTRCTO", _number(cycle["up"]), "MMPM", _number(cycle["F"])]
    if cycle["Q"] > 0.0 and cycle["name"] in ("G83", "G73"):
        parts += ["STEP", _number(cycle["Q"])]
    if cycle["P"] > 0.0:
        parts += ["DWELL", _number(cycle["P"])]
    return ",".join(parts)


def _goto(point):
    return "GOTO/" + ",".join(_number(v) for v in point)


def _number(value):
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _plain(text):
    return "".join(c if 32 <= ord(c) < 127 and c != "$" else "_" for c in str(text)) or "job"
