"""The workbench as a server of this machine: one page and its answers, behind a random token.

A page of another site can neither read nor change anything: the address holds a token that nobody
can guess, the host must be this machine's own name (a name that a foreign site lets point here is
refused), and what changes something must come from the page itself.
"""

from __future__ import annotations

import base64
import errno
import hashlib
import json
import re
import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from postproc.cell import load_cell
from postproc.errors import DataError, PostprocError, SourceRef, UsageError
from postproc.jobs.check_cell import check_cell
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.jobs.pages import page_of_cell
from postproc.report.pages.workbench import workbench_page
from postproc.report.parts import Page
from postproc.workbench.bench import Bench
from postproc.workbench.edits import KINDS, Thing

_HOST = "127.0.0.1"
_MOST_BYTES = 1 << 16
"""No request is larger."""
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
_SCRIPT = re.compile(rb'<script type="module">(.*?)</script>', re.DOTALL)


class Workbench:
    """The application of a cell, and of an input in it; ``token`` is first in every path."""

    def __init__(self, cell: Path, bench: Bench | None, port: int) -> None:
        """Take the cell, what is edited in it (None: the cell alone is shown), and the port."""
        self.cell, self.port = cell, port
        self.token = secrets.token_urlsafe(24)
        posts = self._posts(bench) if bench else []
        self.app = Starlette(routes=[*self._gets(bench), *posts])

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{_HOST}:{self.port}/{self.token}/"

    def _gets(self, bench: Bench | None) -> list[Route]:
        def packed(content: bytes) -> Response:
            headers = {**_HEADERS, "Content-Encoding": "gzip"}
            return Response(content, media_type="application/json", headers=headers)

        if bench is None:
            answers = {"": lambda: _shown(_cell_page(self.cell))}
        else:
            page = workbench_page(bench.cell.name, bench.source.name)
            answers = {
                "": lambda: _shown(page),
                "state": lambda: JSONResponse(bench.state(), headers=_HEADERS),
                "plan": lambda: packed(bench.page()),
                "map": lambda: packed(bench.spins()),
                "place": lambda: _shown(bench.place()),
            }

        def route(name: str, answer: Callable[[], Response]) -> Route:
            async def get(request: Request) -> Response:
                refused = self._refusal(request)
                return refused if refused is not None else await run_in_threadpool(answer)

            return Route(f"/{{token}}/{name}", get, methods=["GET"])

        return [route(name, answer) for name, answer in answers.items()]

    def _posts(self, bench: Bench) -> list[Route]:
        answers: dict[str, Callable[[dict[str, Any]], Any]] = {
            "pose": lambda asked: bench.pose(_whole(asked, "tag"), _number(asked, "spin_deg")),
            "pin": lambda asked: bench.pin(_whole(asked, "tag"), _number(asked, "spin_deg")),
            "unpin": lambda asked: bench.pin(_whole(asked, "tag"), None),
            "around": lambda asked: bench.around(_whole(asked, "tag")),
            "reach": lambda asked: bench.reach(_thing(asked), *_frame(asked)),
            "move": lambda asked: bench.move(_thing(asked), *_frame(asked)),
            "why": lambda asked: bench.ask("why"),
            "place": lambda asked: bench.ask("place"),
            "cure": lambda asked: bench.cure(_whole(asked, "cause")),
            "undo": lambda asked: bench.step(-1),
            "redo": lambda asked: bench.step(1),
            "reload": lambda asked: bench.reload(),
            "save": lambda asked: bench.save(),
        }

        def route(name: str, answer: Callable[[dict[str, Any]], Any]) -> Route:
            async def post(request: Request) -> Response:
                refused = self._refusal(request, changes=True)
                if refused is not None:
                    return refused
                try:
                    content = await run_in_threadpool(answer, await _asked(request))
                except PostprocError as error:
                    refusal = {"error": str(error), "hint": error.hint or ""}
                    return JSONResponse(refusal, 400, headers=_HEADERS)
                return JSONResponse(content or {}, headers=_HEADERS)

            return Route(f"/{{token}}/{name}", post, methods=["POST"])

        return [route(name, answer) for name, answer in answers.items()]

    def _refusal(self, request: Request, *, changes: bool = False) -> Response | None:
        """Return why a request is not answered; None where it may be."""
        own = {f"{name}:{self.port}" for name in (_HOST, "localhost")}
        given = request.path_params["token"].encode()
        if request.headers.get("host") not in own:
            return Response("the host is not this machine", 403, headers=_HEADERS)
        if not secrets.compare_digest(given, self.token.encode()):
            return Response("no such page", 404, headers=_HEADERS)
        origin = request.headers.get("origin")
        if (changes or origin is not None) and origin not in {f"http://{name}" for name in own}:
            return Response("the request comes from another page", 403, headers=_HEADERS)
        return None


def open_workbench(cell: Path, source: Path | None, port: int, tell: Callable[[str], None]) -> None:
    """Serve a workbench, of the cell alone without a source, until it is interrupted.

    Port 0 takes a free one; ``tell`` is called with the address when it can be opened. What goes
    wrong later, when the files are read again, is said in the page.
    """
    loaded = load_cell(cell)
    if source:
        read_toolpath(ConvertRequest(str(source), str(cell)), loaded)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((_HOST, port))
    except OSError as problem:
        taken = problem.errno == errno.EADDRINUSE
        text = f"port {port} is taken" if taken else f"port {port}: {problem.strerror}"
        hint = "leave --port out for a free one"
        raise UsageError("UI002", text, SourceRef("postproc"), hint) from None
    bench = Bench(cell, source) if source else None
    workbench = Workbench(cell, bench, listening.getsockname()[1])
    settings = uvicorn.Config(
        workbench.app,
        log_level="error",
        access_log=False,
        lifespan="off",
        server_header=False,
        timeout_graceful_shutdown=1,
        http="h11",
        ws="none",
    )
    try:
        if bench:
            bench.reload()
        listening.listen()
        tell(workbench.address)
        uvicorn.Server(settings).run(sockets=[listening])
    except KeyboardInterrupt:
        pass  # how it is meant to end
    finally:
        if bench:
            bench.close()
        listening.close()


def _cell_page(path: Path) -> bytes:
    """Return the page of a cell, or of what is wrong with its file."""
    try:
        return page_of_cell(check_cell(load_cell(path)))
    except PostprocError as error:
        return Page(path.name, [str(error), error.hint or ""]).render()


def _shown(page: bytes) -> Response:
    headers = {**_HEADERS, "Content-Security-Policy": _policy(page)}
    return Response(page, media_type="text/html", headers=headers)


def _policy(page: bytes) -> str:
    """Return the policy of a page: its own script, its own server, nothing else."""
    script = _SCRIPT.search(page)
    digest = hashlib.sha256(script[1] if script else b"").digest()
    return (
        "default-src 'none'; connect-src 'self'; img-src data: blob:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{base64.b64encode(digest).decode()}'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    )


async def _asked(request: Request) -> dict[str, Any]:
    """Return the JSON object of a request."""
    raw = b""
    async for part in request.stream():
        raw += part
        if len(raw) > _MOST_BYTES:
            raise _wrong(f"more than {_MOST_BYTES} bytes")
    try:
        content = json.loads(raw or b"{}")
    except (ValueError, RecursionError):
        raise _wrong("not JSON") from None
    if not isinstance(content, dict):
        raise _wrong("expected an object")
    return content


def _number(asked: dict[str, Any], key: str) -> float:
    value = asked.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e9:
        raise _wrong(f"{key}: expected a number")
    return float(value)


def _whole(asked: dict[str, Any], key: str) -> int:
    value = _number(asked, key)
    if value != int(value):
        raise _wrong(f"{key}: expected a whole number")
    return int(value)


def _thing(asked: dict[str, Any]) -> Thing:
    kind = asked.get("kind")
    if kind not in KINDS:
        raise _wrong(f"kind: expected one of {', '.join(KINDS)}")
    return kind, _whole(asked, "index")


def _frame(asked: dict[str, Any]) -> tuple[list[float], list[float]]:
    parts = []
    for key in ("xyz_mm", "abc_deg"):
        values = asked.get(key)
        if not isinstance(values, list) or len(values) != 3:
            raise _wrong(f"{key}: expected three numbers")
        parts.append([_number({key: value}, key) for value in values])
    return parts[0], parts[1]


def _wrong(text: str) -> DataError:
    return DataError("UI011", text, SourceRef("request"))
