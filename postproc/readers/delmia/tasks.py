"""DELMIA tasks that call tasks: expanded in the order in which they run."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.readers.delmia.records import Call, Document, Motion, Statement
from postproc.readers.text import Faults

MOST_ITEMS = 5_000_000
"""Calls of calls can multiply; more than this is not a robot's program."""


def expanded(
    document: Document, task: str | None, faults: Faults
) -> Iterator[tuple[str, Motion | Statement]]:
    """Yield task name and activity, calls followed, of a task or of all that no other one calls."""
    roots = _roots(document, task, faults)
    sizes: dict[str, int] = {}
    for root in roots:
        _size(document, root, sizes, faults)
    if sum(sizes[root] for root in roots) > MOST_ITEMS:
        raise faults.error("DEL012", f"the tasks' calls make more than {MOST_ITEMS} activities", 1)
    for root in roots:
        yield from _run(document, root)


def _roots(document: Document, task: str | None, faults: Faults) -> list[str]:
    if task is not None:
        if task not in document.tasks:
            known = ", ".join(document.tasks)
            raise faults.error("DEL013", f"no task {task!r}, known are {known[:300]}", 1)
        return [task]
    called = {
        item.task for items in document.tasks.values() for item in items if isinstance(item, Call)
    }
    roots = [name for name in document.tasks if name not in called]
    if not roots and document.tasks:
        first = next(iter(document.tasks))
        text = "tasks call each other in a circle"
        raise faults.error("DEL011", text, document.task_lines[first])
    if len(roots) > 1:
        text = (
            f"{len(roots)} tasks that no other one calls, read one after the other: "
            f"{', '.join(roots)[:200]}"
        )
        faults.warn("DEL110", text, document.task_lines[roots[1]])
    return roots


def _size(document: Document, root: str, sizes: dict[str, int], faults: Faults) -> None:
    """Fill ``sizes`` with the number of activities each task runs, without recursion."""
    open_tasks: dict[str, Iterator[Call]] = {root: _calls(document, root)}
    while open_tasks:
        name = next(reversed(open_tasks))
        call = next((c for c in open_tasks[name] if c.task not in sizes), None)
        if call is None:
            del open_tasks[name]
            sizes[name] = sum(
                sizes[item.task] if isinstance(item, Call) else 1 for item in document.tasks[name]
            )
            continue
        if call.task not in document.tasks:
            text = f"task {name!r} calls {call.task!r}, which is not in the file"
            raise faults.error("DEL010", text, call.line)
        if call.task in open_tasks:
            text = f"tasks call each other in a circle: {name!r} calls {call.task!r}"
            raise faults.error("DEL011", text, call.line)
        open_tasks[call.task] = _calls(document, call.task)


def _calls(document: Document, name: str) -> Iterator[Call]:
    return (item for item in document.tasks[name] if isinstance(item, Call))


def _run(document: Document, root: str) -> Iterator[tuple[str, Motion | Statement]]:
    stack = [(root, iter(document.tasks[root]))]
    while stack:
        name, items = stack[-1]
        item = next(items, None)
        if item is None:
            stack.pop()
        elif isinstance(item, Call):
            stack.append((item.task, iter(document.tasks[item.task])))
        else:
            yield name, item
