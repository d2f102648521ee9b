"""The planner in a process of its own: it works while the page answers, and is left when outdated.

``convert`` itself runs there, on the bytes that will be saved, so that what is shown is the
program that ``convert`` writes.
"""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import Any

from postproc.cell import Cell, parse_cell
from postproc.errors import PostprocError
from postproc.jobs.convert import Conversion, ConvertRequest, convert, explained, read_toolpath
from postproc.jobs.pages import workbench_data
from postproc.jobs.place import PlaceJob, place
from postproc.planning import spin_map
from postproc.records import dataclass
from postproc.units import MM

_AROUND = 1000.0
"""How far [mm] a better place is looked for along each axis where no solid keeps the part off."""
Report = Callable[[int, int, str], None]
Listener = Callable[[int, str, Any], None]
"""Called with the number of an order, what it is about, and the thing itself."""


@dataclass(frozen=True, slots=True)
class Order:
    """What to plan: the input, the bytes of the cell and where it stands, pins as CSV.

    ``map_too``: the map over the spin has to be made anew. ``task``: ``plan``; ``why`` the plan has
    failed, with cures; or a better ``place`` of the part.
    """

    number: int
    source: str
    cell: bytes
    cell_path: str
    pins: bytes
    map_too: bool = True
    task: str = "plan"


class _OutdatedError(BaseException):
    """Something newer is asked; not an ``Exception``, so that nothing on the way keeps it."""


class Planner:
    """One process that takes one order at a time; a new order makes it leave the one before."""

    def __init__(self, listener: Listener) -> None:
        """Take whom to tell of progress, of what was asked, of ``failed`` and ``ended``."""
        self._context = multiprocessing.get_context("spawn")
        self._wanted: Synchronized[int] = self._context.Value("q", 0)
        self._listener = listener
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def ask(self, order: Order) -> None:
        """Let an order be worked on instead of all before."""
        self._wanted.value = order.number
        if self._process is None or not self._process.is_alive() or self._pipe is None:
            self._start()
        if self._pipe is not None:
            self._pipe.send(order)

    def close(self) -> None:
        """End the process; nobody is told that it has ended."""
        self._pipe = None
        if self._process is not None and self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _start(self) -> None:
        self._pipe, theirs = self._context.Pipe()
        self._process = self._context.Process(
            target=_work, args=(theirs, self._wanted), daemon=True, name="postproc planner"
        )
        self._process.start()
        theirs.close()
        threading.Thread(target=self._listen, args=(self._pipe,), daemon=True).start()

    def _listen(self, pipe: Connection) -> None:
        while True:
            try:
                number, what, content = pipe.recv()
            except (EOFError, OSError):
                if pipe is self._pipe:  # else it was ended on purpose, and another works
                    self._listener(self._wanted.value, "ended", None)
                return
            if number == self._wanted.value:
                self._listener(number, what, content)


def _work(pipe: Connection, wanted: Synchronized[int]) -> None:
    """Take orders until the other side is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    worker = _Worker(pipe, wanted)
    while True:
        try:
            order = pipe.recv()
        except (EOFError, OSError):
            return
        if order.number == wanted.value:
            worker.run(order)


class _Worker:
    """Keeps the cell from order to order, and with it its solids."""

    def __init__(self, pipe: Connection, wanted: Synchronized[int]) -> None:
        self._pipe, self._wanted = pipe, wanted
        self._known: tuple[bytes, str] | None = None
        self._cell: Cell | None = None

    def run(self, order: Order) -> None:
        def progress(done: int, total: int, what: str) -> None:
            if self._wanted.value != order.number:
                raise _OutdatedError
            self._pipe.send((order.number, "progress", (done, total, what)))

        try:
            for what, content in self._answers(order, progress):
                self._pipe.send((order.number, what, content))
            self._pipe.send((order.number, "done", None))
        except _OutdatedError:
            pass
        except PostprocError as error:
            self._pipe.send((order.number, "failed", (str(error), error.hint or "")))
        except MemoryError:
            self._pipe.send((order.number, "failed", ("not enough memory for this input", "")))
        except Exception:  # noqa: BLE001 - a bug of ours
            text = traceback.format_exc().strip().splitlines()[-1]
            self._pipe.send((order.number, "failed", (f"a bug of postproc: {text}", "")))

    def _answers(self, order: Order, progress: Report) -> Iterator[tuple[str, Any]]:
        """Yield what is asked for, as it comes."""
        if order.task == "place":
            yield "place", self._placed(order, progress)
            return
        conversion, request = self._converted(order, progress)
        if order.task == "why":
            yield "why", list(explained(conversion, request, progress).causes)
            return
        yield "plan", (conversion, workbench_data(conversion))
        if order.map_too:
            yield "map", spin_map(conversion.plan, conversion.cell, progress)

    def _placed(self, order: Order, progress: Report) -> PlaceJob:
        """Return the best place; within a metre of the present one where no solid tells more."""
        cell = self._cell_of(order)
        origin = cell.T_robroot_base[:3, 3] / MM
        box = [*(origin - _AROUND), *(origin + _AROUND)]
        has_solid = any(base.meshes for base in cell.bases)
        toolpath = read_toolpath(ConvertRequest(order.source, order.cell_path), cell)
        return place(toolpath, cell, None if has_solid else box, progress=progress)

    def _converted(self, order: Order, progress: Report) -> tuple[Conversion, ConvertRequest]:
        progress(0, 0, "read")
        cell = self._cell_of(order)
        with tempfile.TemporaryDirectory(prefix="postproc_pins") as folder:
            pins = Path(folder) / "pins.csv"
            pins.write_bytes(order.pins)
            request = ConvertRequest(
                order.source, order.cell_path, pins=str(pins) if order.pins else None
            )
            return convert(request, progress, cell=cell), request

    def _cell_of(self, order: Order) -> Cell:
        if self._known != (order.cell, order.cell_path) or self._cell is None:
            self._cell = parse_cell(order.cell, order.cell_path)
            self._known = order.cell, order.cell_path
        return self._cell
