"""What all browsers look at: the files, the edits, and the newest plan made of them."""

from __future__ import annotations

import gzip
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from postproc.cell import Cell
from postproc.errors import DataError, PostprocError, SourceRef
from postproc.files import write_files
from postproc.geometry import transform_from_kuka
from postproc.jobs.causes import Cause
from postproc.jobs.convert import Conversion
from postproc.jobs.place import PlaceJob
from postproc.planning import SpinMap, TagPoses, replanned
from postproc.records import dataclass
from postproc.report.pages.workbench import (
    around_data,
    map_data,
    page_json,
    pose_answer,
    reach_data,
)
from postproc.units import DEG
from postproc.workbench.edits import (
    PART,
    Edits,
    Thing,
    carrier_of,
    frame_of,
    moved_file,
    pins_file,
    placed,
    things,
)
from postproc.workbench.planner import Order, Planner

_MOST_STEPS = 500
"""Edits that can be undone."""
_FULL_TURN = 360.0
_FARTHEST = 1e5
"""Largest coordinate of a frame [mm], as the cell file takes it."""


@dataclass(frozen=True, slots=True)
class _Shown:
    """A plan as browsers get it: its number, the conversion, the page's data, how tags stand."""

    number: int
    conversion: Conversion
    page: bytes
    poses: TagPoses


class Bench:
    """One cell, one input, and what is edited; safe to be used from many threads."""

    def __init__(self, cell: Path, source: Path) -> None:
        """Take the files; nothing is read before ``reload``."""
        self.cell, self.source = cell, source
        self._lock = threading.RLock()
        self._asking = threading.Lock()
        self._planner = Planner(self._receive)
        self._steps: list[Edits] = [Edits()]
        self._at = 0
        self._number = 0
        self._shown: _Shown | None = None
        self._map: tuple[int, SpinMap, bytes] | None = None
        self._mapped: tuple[bytes, str] | None = None
        self._key: tuple[bytes, str] | None = None
        self._state: dict[str, Any] = {"busy": True, "progress": [0, 0, "read"]}
        self._causes: Sequence[Cause] = ()
        self._place = b""

    # ---- what is asked of the planner -----------------------------------------------------------

    def reload(self) -> None:
        """Read the files again and plan; edits stay."""
        with self._lock:
            self._planner.close()
            self._mapped = None
            self._plan()

    def close(self) -> None:
        """End the planner."""
        self._planner.close()

    @property
    def edits(self) -> Edits:
        """The edits as they are now."""
        return self._steps[self._at]

    def ask(self, task: str) -> None:
        """Ask why the plan that is shown has failed, or for a better place of the part."""
        with self._lock:
            self._require_shown()
            self._plan(task)

    def _plan(self, task: str = "plan") -> None:
        """Ask for the plan of the edits as they are now, or for what else can be told of them."""
        self._causes = () if task == "plan" else self._causes
        self._number += 1
        self._state = {"busy": True, "progress": [0, 0, "read"]}
        try:
            raw = self.edits.cell_toml(self.cell)
        except PostprocError as error:
            self._state = {"busy": False, "error": str(error), "hint": error.hint or ""}
            return
        # a cure is told by keys of the file that is there
        path = self.cell if task == "why" else moved_file(self.cell, self.edits)
        key = raw, str(path)
        pins = self.edits.pins_csv() if self.edits.pins else b""
        wanted = task == "plan" and self._mapped != key
        self._planner.ask(Order(self._number, str(self.source), *key, pins, wanted, task))
        if task != "plan":
            return
        self._mapped = None if self._mapped != key else key
        self._key = key

    def _receive(self, number: int, what: str, content: Any) -> None:  # noqa: ANN401 - of its kind
        """Take what the planner tells of an order."""
        self._take(number, what, content)
        if what == "plan" and self._shown and len(self._shown.conversion.toolpath):
            with self._asking:  # the solids are built before somebody drags
                self._shown.poses.at(0, 0.0)

    def _take(self, number: int, what: str, content: Any) -> None:  # noqa: ANN401 - of its kind
        with self._lock:
            if number != self._number:
                return
            if what == "progress":
                self._state["progress"] = list(content)
            elif what == "plan":
                conversion, page = content
                packed = gzip.compress(page, compresslevel=1)
                poses = TagPoses(conversion.plan, conversion.cell)
                self._shown = _Shown(number, conversion, packed, poses)
                self._state.pop("error", None)
            elif what == "map":
                self._map = (
                    number,
                    content,
                    gzip.compress(page_json(map_data(content)), compresslevel=1),
                )
                still = not self._shown or not self._shown.conversion.cell.external_axes
                self._mapped = self._key if still else None
            elif what == "why":
                self._causes = content
            elif what == "place":
                self._take_place(content)
            elif what == "done":
                self._state["busy"] = False
            elif what == "failed":
                self._state = {"busy": False, "error": content[0], "hint": content[1]}
            elif self._state["busy"]:
                text = "the planner has ended: out of memory, or ended by the system"
                self._state = {"busy": False, "error": text, "hint": "reload starts it again"}

    def _take_place(self, job: PlaceJob) -> None:
        """Keep the page of a place that was found, and move the part there."""
        self._place = job.page()
        if not job.good:
            told = job.document
            text = f"no good place was found; the best serves {told['tags_good']} of {told['tags']}"
            self._state["error"] = f"{text} tags"
        else:
            edits = self.edits
            for thing in things(job.cell):
                if thing[0] == PART:
                    frame = frame_of(job.cell, thing)
                    edits = edits.moved(thing, frame["xyz_mm"], frame["abc_deg"])
            self._edit(edits)

    # ---- edits ----------------------------------------------------------------------------------

    def pin(self, tag: int, spin_deg: float | None) -> None:
        """Pin a tag of the plan to a spin [deg], or take its pin away."""
        with self._lock:
            name = self._tag_name(tag)
            if spin_deg is None:
                if name not in self.edits.pins:
                    raise self._wrong(f"tag {name} has no pin that was set here")
            elif abs(spin_deg) > _FULL_TURN:
                raise self._wrong(f"a spin of {spin_deg:g} deg, expected -360 to 360")
            self._edit(self.edits.pinned(name, spin_deg))

    def around(self, tag: int) -> dict[str, Any]:
        """Return what the edits make of the tags around one at once, all others as they are."""
        with self._lock:
            self._tag_name(tag)
            conversion, edits = self._require_shown().conversion, self.edits
            known = {name for step in self._steps for name in step.pins}
        cell, plan = conversion.cell, conversion.plan
        pins = {name: spin for name, spin in cell.optimize.pins.items() if name not in known}
        pins |= {name: spin * DEG for name, spin in edits.pins.items()}
        cell = replace(cell, optimize=replace(cell.optimize, pins=pins))
        with self._asking:
            made, tags = replanned(plan, cell, tag)
        return around_data(made, tags)

    def move(self, thing: Thing, xyz_mm: Sequence[float], abc_deg: Sequence[float]) -> None:
        """Put a part, a tool or a fixture elsewhere."""
        with self._lock:
            self._require_place(thing, xyz_mm, abc_deg)
            self._edit(self.edits.moved(thing, xyz_mm, abc_deg))

    def cure(self, cause: int) -> None:
        """Change the cell as a cause says."""
        with self._lock:
            if not 0 <= cause < len(self._causes) or not self._causes[cause].changes:
                raise self._wrong("this is nothing that the cell file could cure")
            self._edit(self.edits.cured(self.cell, self._causes[cause].changes))

    def step(self, by: int) -> None:
        """Undo (-1) or do again (+1) an edit; nothing where there is none."""
        with self._lock:
            if 0 <= self._at + by < len(self._steps):
                self._at += by
                self._plan()

    def _edit(self, edits: Edits) -> None:
        if edits == self.edits:
            return
        self._steps = [*self._steps[: self._at + 1], edits][-_MOST_STEPS:]
        self._at = len(self._steps) - 1
        self._plan()

    def save(self) -> dict[str, Any]:
        """Write the edits as files beside the cell; say the call of ``convert`` they are for."""
        with self._lock:
            edits, cell = self.edits, moved_file(self.cell, self.edits)
            raw = edits.cell_toml(self.cell)
        files = {cell: raw} if edits.of_cell else {}
        call = f"postproc convert {self.source} --cell {cell} -o out"
        if edits.pins:
            pins = pins_file(self.cell, self.source)
            files[pins] = edits.pins_csv()
            call += f" --pins {pins}"
        if not files:
            raise self._wrong("nothing was edited")
        write_files(files)
        return {"files": [str(path) for path in files], "call": call}

    # ---- answers --------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """Return what is going on, small enough to be asked several times a second."""
        with self._lock:
            shown = self._shown
            return {
                **self._state,
                "number": self._number,
                "plan": shown.number if shown else 0,
                "map": self._map[0] if self._map else 0,
                "pins": dict(self.edits.pins),
                "undo": self._at,
                "redo": len(self._steps) - 1 - self._at,
                "things": _things(shown.conversion.cell) if shown else [],
                "good": bool(shown and shown.conversion.good),
                "causes": [
                    {"text": cause.text, "cell": bool(cause.changes)} for cause in self._causes
                ],
                "has_place": bool(self._place),
            }

    def page(self) -> bytes:
        """Return the data of the plan, gzip of JSON; of nothing where there is no plan."""
        with self._lock:
            return self._shown.page if self._shown else gzip.compress(b"null")

    def place(self) -> bytes:
        """Return the page of the last search for a better place."""
        with self._lock:
            return self._place

    def spins(self) -> bytes:
        """Return the map over the spin, as ``page``."""
        with self._lock:
            return self._map[2] if self._map else gzip.compress(b"null")

    def program(self) -> Mapping[str, bytes]:
        """Return the program files of the plan that is shown."""
        with self._lock:
            return dict(self._shown.conversion.files) if self._shown else {}

    def pose(self, tag: int, spin_deg: float) -> dict[str, Any]:
        """Return how a tag would stand at a spin [deg]."""
        with self._lock:
            self._tag_name(tag)
            shown = self._require_shown()
        with self._asking:
            found = shown.poses.at(tag, spin_deg * DEG)
        if found is None:
            raise self._wrong("no tool or base of the cell serves this tag")
        return {"tag": tag, "spin_deg": spin_deg, **pose_answer(found)}

    def reach(
        self, thing: Thing, xyz_mm: Sequence[float], abc_deg: Sequence[float]
    ) -> dict[str, Any]:
        """Return how all tags would stand with a thing elsewhere, without planning."""
        with self._lock:
            conversion = self._require_place(thing, xyz_mm, abc_deg)
        cell = placed(conversion.cell, thing, transform_from_kuka(xyz_mm, abc_deg))
        with self._asking:
            kind, stiffness = TagPoses(conversion.plan, cell).reach()
        return reach_data(kind, stiffness)

    def _require_place(
        self, thing: Thing, xyz_mm: Sequence[float], abc_deg: Sequence[float]
    ) -> Conversion:
        """Return what is shown, if one of its things can stand there."""
        conversion = self._require_shown().conversion
        if thing not in things(conversion.cell):
            raise self._wrong(f"no {thing[0]} {thing[1]} in the cell")
        if max(map(abs, xyz_mm)) > _FARTHEST or max(map(abs, abc_deg)) > _FULL_TURN:
            raise self._wrong("a frame beyond 100 m or 360 deg")
        return conversion

    def _require_shown(self) -> _Shown:
        if self._shown is None:
            raise self._wrong("there is no plan yet")
        return self._shown

    def _tag_name(self, tag: int) -> str:
        path = self._require_shown().conversion.plan.toolpath
        if not 0 <= tag < len(path):
            raise self._wrong(f"no tag {tag}, expected 0 to {len(path) - 1}")
        return path.tag_name(tag)

    def _wrong(self, text: str) -> DataError:
        return DataError("UI010", text, SourceRef(str(self.source)))


def _things(cell: Cell) -> list[dict[str, Any]]:
    """Return what can be moved, with its frame as the cell file has it."""
    return [
        {
            "kind": thing[0],
            "index": thing[1],
            "name": name,
            "carrier": carrier_of(cell, thing).ravel().tolist(),
            **frame_of(cell, thing),
        }
        for thing, name in things(cell).items()
    ]
