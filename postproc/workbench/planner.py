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
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import Any

from postproc.cell import Cell, parse_cell
from postproc.errors import PostprocError
from postproc.jobs.convert import Conversion, ConvertRequest, convert
from postproc.jobs.pages import workbench_data
from postproc.planning import SpinMap, spin_map
from postproc.records import dataclass

Listener = Callable[[int, str, Any], None]
"""Called with the number of an order, what it is about, and the thing itself."""


@dataclass(frozen=True, slots=True)
class Order:
    """What to plan: the input, the bytes of the cell and where it stands, pins as CSV.

    ``map_too``: the map over the spin has to be made anew.
    """

    number: int
    source: str
    cell: bytes
    cell_path: str
    pins: bytes
    map_too: bool = True


class _OutdatedError(BaseException):
    """Something newer is asked; not an ``Exception``, so that nothing on the way keeps it."""


class Planner:
    """One process that takes one order at a time; a new order makes it leave the one before."""

    def __init__(self, listener: Listener) -> None:
        """Take whom to tell ``progress``, ``plan``, ``map``, ``failed`` and ``ended``."""
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
            conversion = self._converted(order, progress)
            page = workbench_data(conversion)
            self._pipe.send((order.number, "plan", (conversion, page)))
            if order.map_too:
                spins: SpinMap = spin_map(conversion.plan, conversion.cell, progress)
                self._pipe.send((order.number, "map", spins))
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

    def _converted(self, order: Order, progress: Callable[[int, int, str], None]) -> Conversion:
        progress(0, 0, "read")
        if self._known != (order.cell, order.cell_path) or self._cell is None:
            self._cell = parse_cell(order.cell, order.cell_path)
            self._known = order.cell, order.cell_path
        with tempfile.TemporaryDirectory(prefix="postproc_pins") as folder:
            pins = Path(folder) / "pins.csv"
            pins.write_bytes(order.pins)
            request = ConvertRequest(
                order.source, order.cell_path, pins=str(pins) if order.pins else None
            )
            return convert(request, progress, cell=self._cell)
