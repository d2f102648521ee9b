"""Which tool and which base of the cell every tag of a CAM file means.

A CAM file calls tools by numbers and names (LOADTL, TLDATA, tool profiles) and setups by names
(MSYS, CSYS, object frames). An entry of the cell assigned them by its ``cam``. A cell with one tool
takes a file that never changes the tool as it is; the same holds for setups.

A setup that the file itself places needs no entry: its points are carried by its matrix, into the
coordinates of the part, or into those of a setup that an entry lists. An entry that lists it
wins: then the points stay as they are written, and the base lies where the cell says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray, IndexArray, IntArray, runs
from postproc.cell import Cell, Tool, Workpiece, cam_key
from postproc.errors import CellError, Finding, Severity, SourceRef, listed
from postproc.geometry import apply, inverse
from postproc.model import Arcs, CamSetup, CamTool, EventKind, MotionKind, ToolPath, WordUse
from postproc.records import dataclass
from postproc.units import MM

UNASSIGNED = -1
SETUP_WORDS = frozenset({"MCSYS", "MCS", "MCS2", "ZERO", "CUTCOM/ADJUST"})
"""Words that name a setup of which only a cell can say where the points lie."""
_SAME_DIAMETER = 0.01 * MM


@dataclass(frozen=True, slots=True)
class ToolStretch:
    """Tags [low, high) that one tool serves in one base: indices into those of the cell."""

    low: int
    high: int
    tool: int
    base: int

    @property
    def is_assigned(self) -> bool:
        """Whether the cell knows both."""
        return self.tool >= 0 and self.base >= 0


@dataclass(frozen=True, slots=True)
class Assignment:
    """A toolpath as the tools and bases of a cell serve it.

    ``toolpath``: points and axes in the base of each tag; ``tool``, ``base`` (n,): indices into
    those of the cell, -1 where no entry lists what the file asks for; ``findings``: what is
    wrong with that.
    """

    toolpath: ToolPath
    tool: IntArray
    base: IntArray
    findings: tuple[Finding, ...] = ()

    def of(self, tags: IndexArray) -> Assignment:
        """Return those of some tags (k,) alone; the toolpath and what is wrong stay whole."""
        return replace(self, tool=self.tool[tags], base=self.base[tags])

    def stretches(self) -> list[ToolStretch]:
        """Return the stretches with one tool in one base, in order."""
        return [
            ToolStretch(low, high, int(self.tool[low]), int(self.base[low]))
            for low, high in runs(np.stack([self.tool, self.base]))
        ]


def assign(toolpath: ToolPath, cell: Cell) -> Assignment:
    """Return what each tag means in a cell; done twice it is as done once.

    CellError if no tag at all has a tool and a base, with what the file asks for.
    """
    assigner = _Assigner(toolpath, cell)
    tool, base = assigner.tools(), assigner.bases()
    if len(toolpath) and not ((tool >= 0) & (base >= 0)).any():
        worst = next(finding for finding in assigner.findings if finding.is_error)
        raise CellError(worst.code, worst.message, worst.source, worst.hint)
    served = assigner.served(tool)
    findings = (*assigner.findings, *_lost_arcs(served, tool, base))
    return Assignment(served, tool, base, findings)


def words_settled(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return a toolpath without the refused words that a base of the cell answers."""
    assigner = _Assigner(toolpath, cell)
    assigner.bases()
    return assigner.settled(toolpath)


def bases_named(names: Sequence[str], cell: Cell) -> IntArray:
    """Return the bases (n,) that names of a list mean: indices into those of a cell, -1 for none.

    A row without a name is in the only base, or in the one without CAM names.
    """
    free = [index for index, base in enumerate(cell.bases) if not base.cam]
    nobody = free[0] if len(free) == 1 else UNASSIGNED
    if len(cell.bases) == 1 and len({name for name in names if name}) < 2:
        return np.zeros(len(names), dtype=np.int32)
    table = {key: index for index, base in enumerate(cell.bases) for key in base.cam}
    keys = (cam_key(name) if name else "" for name in names)
    return np.array([table.get(k, UNASSIGNED) if k else nobody for k in keys], dtype=np.int32)


@dataclass(frozen=True, slots=True)
class _Calls:
    """What a file calls, tools or setups, beside the entries of a cell that can be meant.

    ``column`` (n,): which call each tag follows, -1 for none; ``names`` of each call; ``code`` of
    what is wrong; ``what``, ``word``: a call and an entry in words.
    """

    column: IntArray
    calls: Sequence[CamTool | CamSetup]
    names: tuple[tuple[str, ...], ...]
    entries: Sequence[Tool | Workpiece]
    code: str
    what: str
    word: str

    @classmethod
    def of_tools(cls, toolpath: ToolPath, cell: Cell) -> _Calls:
        """Return the tools that a file calls."""
        names = [
            tuple(filter(None, (tool.name, str(tool.number) if tool.number > 0 else "")))
            for tool in toolpath.tools
        ]
        column = np.asarray(toolpath.tool)
        return cls(column, toolpath.tools, tuple(names), cell.tools, "WRD002", "tool", "tool")

    @classmethod
    def of_setups(cls, toolpath: ToolPath, cell: Cell) -> _Calls:
        """Return the setups that a file names."""
        names = tuple((setup.name, *setup.aliases) for setup in toolpath.setups)
        column = toolpath.setup_of_tags
        return cls(column, toolpath.setups, names, cell.bases, "WRD020", "setup", "base")

    @property
    def used(self) -> list[int]:
        """The calls that some tag follows."""
        return list(map(int, np.unique(self.column[self.column >= 0])))

    @property
    def is_single(self) -> bool:
        """Whether a file that never changes is served by the only entry, whatever it calls."""
        return len(self.entries) == 1 and len(self.used) < 2

    def served(self, entry: Mapping[int, int], nobody: int) -> IntArray:
        """Return the entries (n,) of tags; those of no call have ``nobody``."""
        table = [entry.get(index, UNASSIGNED) for index in range(len(self.calls))]
        return np.maximum([*table, nobody], UNASSIGNED)[self.column].astype(np.int32)


@dataclass(slots=True)
class _Assigner:
    """Finds the entries for one toolpath; collects the findings on the way."""

    toolpath: ToolPath
    cell: Cell
    findings: list[Finding] = field(default_factory=list)
    maps: dict[int, FloatArray] = field(default_factory=dict)
    """Setup to T_base_points (4, 4), where the points have to move."""
    listed: set[int] = field(default_factory=set)
    """Setups that an entry lists."""

    def tools(self) -> IntArray:
        """Return the tool (n,) of each tag."""
        calls = _Calls.of_tools(self.toolpath, self.cell)
        entry = self._entries(calls)
        if calls.is_single:
            entry = dict.fromkeys(calls.used, 0)
        for index, place in entry.items():
            tool = self.toolpath.tools[index]
            if place == UNASSIGNED:
                subject = f"{tool_words(tool)}, called in line {tool.line},"
                self._unknown(calls, index, subject, tool.name or str(tool.number))
            elif place >= 0:
                own = self.cell.tools[place]
                if abs(tool.diameter - own.diameter) > _SAME_DIAMETER:
                    text = f"{tool_words(tool)} has another diameter than the cutter of tool "
                    text += f"{own.number} {own.name} in the cell, {own.diameter / MM:g} mm"
                    self._warn("WRD022", text, tool)
        self._warn_of_alike({index: place for index, place in entry.items() if place >= 0})
        nobody = 0
        if not calls.is_single:
            start, hint = "no tool is called before", "let the file name the tool of every motion"
            nobody = self._before_any(calls, start, hint)
        return calls.served(entry, nobody)

    def bases(self) -> IntArray:
        """Return the base (n,) of each tag, and remember where its points have to go."""
        calls, setups = _Calls.of_setups(self.toolpath, self.cell), self.toolpath.setups
        entry = self._entries(calls)
        self.listed = {index for index, place in entry.items() if place >= 0}
        for index in self.listed:
            self._map(index, _moved_back(setups[index]))
        rest = [index for index, place in entry.items() if place == UNASSIGNED]
        if calls.is_single:
            entry, rest = dict.fromkeys(calls.used, 0), []
        home, T_home_part = self._part_base(entry)
        for index in rest:
            if home >= 0 and setups[index].matrix is not None:
                entry[index] = home
                self._map(index, T_home_part)
            else:
                name = setups[index].name
                self._unknown(calls, index, f"setup {name}, line {setups[index].line},", name)
        if home >= 0 and (calls.column < 0).any():
            self._map(UNASSIGNED, T_home_part)
        elif home < 0:
            hint = "leave cam out of the one base that holds the coordinates of the part"
            self._before_any(calls, "no setup is named for", hint)
        return calls.served(entry, home)

    def _entries(self, calls: _Calls) -> dict[int, int]:
        """Return the entry that lists each call; an error, and below ``UNASSIGNED``, if two do."""
        entry = {}
        for index in calls.used:
            keys = set(map(cam_key, calls.names[index]))
            found = [k for k, each in enumerate(calls.entries) if keys & set(each.cam)]
            entry[index] = found[0] if found else UNASSIGNED
            if len(found) > 1:
                entry[index] = UNASSIGNED - 1
                numbers = " and ".join(str(calls.entries[k].number) for k in found)
                names = " ".join(calls.names[index])
                text = f"{calls.what} {names} is listed in cam of both {numbers}"
                source = SourceRef(self.toolpath.path, calls.calls[index].line)
                self.findings.append(Finding(Severity.ERROR, "WRD021", text, source=source))
        return entry

    def _unknown(self, calls: _Calls, index: int, subject: str, key: str) -> None:
        rows = np.flatnonzero(calls.column == index)
        text = f"{subject} is no {calls.word} of the cell: {self._lines(rows)}"
        hint = f'add to the [[{calls.word}s]] entry that it is: cam = ["{key}"]; '
        self._error(calls.code, text, int(rows[0]), hint + "inspect prints the table")

    def _before_any(self, calls: _Calls, start: str, hint: str) -> int:
        """Refuse tags of no call, where there are any; several entries may be meant."""
        rows = np.flatnonzero(calls.column < 0)
        if len(rows):
            count = len(calls.entries)
            text = f"{start} {self._lines(rows)}, and the cell has {count} {calls.word}s"
            self._error(calls.code, text, int(rows[0]), hint)
        return UNASSIGNED

    def _warn_of_alike(self, entry: dict[int, int]) -> None:
        """Warn of CAM tools that differ by the file itself and are taken for one tool."""
        tools = self.toolpath.tools
        first: dict[int, int] = {}
        for index, place in entry.items():
            one, two = tools[first.setdefault(place, index)], tools[index]
            named = bool(one.name) and bool(two.name) and cam_key(one.name) != cam_key(two.name)
            if named or abs(one.diameter - two.diameter) > _SAME_DIAMETER:
                served = self.cell.tools[place]
                text = f"{tool_words(one)} and {tool_words(two)} are both taken for tool "
                text += f"{served.number} {served.name}".rstrip()
                hint = "if they are two tools, list each by name in cam, not by number"
                self._warn("WRD024", text, two, hint)

    def _warn(self, code: str, text: str, tool: CamTool, hint: str = "") -> None:
        source = SourceRef(self.toolpath.path, tool.line)
        self.findings.append(Finding(Severity.WARNING, code, text, source=source, hint=hint))

    def _part_base(self, entry: dict[int, int]) -> tuple[int, FloatArray]:
        """Return the base in which the coordinates of the part are known, and T_base_part.

        That of no setup; else the one whose setups all lie at one place of the part.
        """
        bases, setups = self.cell.bases, self.toolpath.setups
        if len(bases) == 1 and not self.listed:
            return 0, np.eye(4)
        free = [index for index, base in enumerate(bases) if not base.cam]
        if len(free) == 1:
            return free[0], np.eye(4)
        known = [(entry[index], _moved_back(setups[index])) for index in sorted(self.listed)]
        if not known or any(base != known[0][0] for base, _ in known):
            return UNASSIGNED, np.eye(4)
        same = all(np.allclose(T, known[0][1], atol=1e-9) for _, T in known)
        return known[0] if same else (UNASSIGNED, np.eye(4))

    def _map(self, index: int, T: FloatArray) -> None:
        if not np.array_equal(T, np.eye(4)):
            self.maps[index] = T

    def served(self, tool: IntArray) -> ToolPath:
        """Return the toolpath with points and axes in the base of each tag."""
        toolpath = self._moved()
        if toolpath.rotations is not None and len(self.cell.tools) > 1:
            axis = self.cell.axes_of(tool)
            axes = -np.einsum("nij,nj->ni", toolpath.rotations, axis) + 0.0
            toolpath = replace(toolpath, axes=axes)
        at = {
            number: event.index
            for number, event in enumerate(toolpath.events)
            if event.kind is EventKind.TOOL_CHANGE and event.index < len(tool)
        }
        called = {number: int(tool[tag]) for number, tag in at.items() if tool[tag] >= 0}
        meant: dict[float, set[int]] = {}
        for number, index in called.items():
            meant.setdefault(toolpath.events[number].value, set()).add(index)
        events = tuple(
            replace(event, value=_called_by(self.cell.tools[called[number]]))
            if number in called and (not event.value or len(meant[event.value]) > 1)
            else event
            for number, event in enumerate(toolpath.events)
        )
        if events != toolpath.events:
            toolpath = replace(toolpath, events=events)
        return self.settled(toolpath)

    def settled(self, toolpath: ToolPath) -> ToolPath:
        """Return the toolpath without the refusals that a listed setup answers."""
        uses = tuple(self._settled_uses())
        return toolpath if uses == toolpath.word_uses else replace(toolpath, word_uses=uses)

    def _moved(self) -> ToolPath:
        """Return the toolpath with its points moved; its setups say so."""
        toolpath = self.toolpath
        if not self.maps:
            return toolpath
        column = toolpath.setup_of_tags
        T = np.stack([self.maps.get(i, np.eye(4)) for i in range(-1, len(toolpath.setups))])
        setups = (
            _served_setup(setup, index in self.listed, self.maps.get(index))
            for index, setup in enumerate(toolpath.setups)
        )
        return replace(carried(toolpath, T[column + 1]), setups=tuple(setups))

    def _settled_uses(self) -> Iterator[WordUse]:
        for use in self.toolpath.word_uses:
            if not use.refused or use.word not in SETUP_WORDS:
                yield use
                continue
            tags = np.searchsorted(self.toolpath.line, use.lines, side="right")
            setups = np.append(self.toolpath.setup_of_tags, UNASSIGNED)[tags].tolist()
            pairs = zip(use.lines, setups, strict=True)
            left = tuple(line for line, setup in pairs if setup not in self.listed)
            if left:
                yield replace(use, lines=left)

    def _error(self, code: str, message: str, tag: int, hint: str) -> None:
        source = self.toolpath.source(tag)
        self.findings.append(Finding(Severity.ERROR, code, message, tag, source, hint=hint))

    def _lines(self, rows: AnyIntArray) -> str:
        """Return the lines of tags as ``12 motions in lines 7 to 18, 40 to 52``."""
        groups = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        line = np.asarray(self.toolpath.line)
        spans = [f"{line[group[0]]} to {line[group[-1]]}" for group in groups]
        return f"{len(rows)} motions in lines {listed(spans)}"


def carried(toolpath: ToolPath, T: FloatArray) -> ToolPath:
    """Return a toolpath whose tags are carried by T (n, 4, 4), arcs with the tags they lead to."""
    R, rotations, arcs = T[:, :3, :3], toolpath.rotations, toolpath.arcs
    of_arc = np.zeros(len(arcs), dtype=np.int64)
    has_arc = np.asarray(toolpath.arc) >= 0
    of_arc[toolpath.arc[has_arc]] = np.flatnonzero(has_arc)
    centre, normal = apply(T[of_arc], arcs.centre), np.einsum("nij,nj->ni", R[of_arc], arcs.normal)
    return replace(
        toolpath,
        points=apply(T, toolpath.points),
        axes=np.einsum("nij,nj->ni", R, toolpath.axes),
        rotations=None if rotations is None else R @ rotations,
        arcs=Arcs(centre, normal, arcs.radius, arcs.sweep),
    )


def tool_words(tool: CamTool) -> str:
    """Return a CAM tool as ``tool 7 DRILL (D 6.35 mm)``."""
    number = f"tool {tool.number}" if tool.number > 0 else "tool"
    name = f" {tool.name}" if tool.name else ""
    size = "" if np.isnan(tool.diameter) else f" (D {tool.diameter / MM:g} mm)"
    return f"{number}{name}{size}"


def _called_by(tool: Tool) -> float:
    """Return the number by which CAM files call a tool, else that of the controller."""
    return float(next((key for key in tool.cam if key.isdecimal()), tool.number))


def _moved_back(setup: CamSetup) -> FloatArray:
    """Return T_setup_points (4, 4): from the points of a toolpath to the setup's own."""
    if not setup.carried or setup.matrix is None:
        return np.eye(4)
    return np.asarray(inverse(np.vstack([setup.matrix, [0.0, 0.0, 0.0, 1.0]])))


def _served_setup(setup: CamSetup, is_assigned: bool, T: FloatArray | None) -> CamSetup:
    if is_assigned:
        return replace(setup, carried=False)
    if T is None or setup.matrix is None:
        return setup
    matrix = (T @ np.vstack([setup.matrix, [0.0, 0.0, 0.0, 1.0]]))[:3]
    return replace(setup, matrix=tuple(tuple(row) for row in matrix.tolist()))


def _lost_arcs(toolpath: ToolPath, tool: IntArray, base: IntArray) -> Iterator[Finding]:
    """Yield the arcs that begin where tool or base change: their way has no start."""
    for tag, _ in runs(np.stack([tool, base]))[1:]:
        if toolpath.kind[tag] == MotionKind.ARC:
            text = "an arc begins where the tool or the base changes"
            hint = "let the CAM system move to the start of the arc after the change"
            yield Finding(Severity.ERROR, "WRD023", text, tag, toolpath.source(tag), hint=hint)
