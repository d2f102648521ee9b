"""The reference: commands, cell keys, CSV columns, JSON documents, findings, Python names."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

import postproc
from postproc.cell import cell_reference
from postproc.cell.schema import CellFile
from postproc.cli.app import COMMANDS
from postproc.codes import Entry, Group, groups
from postproc.measurement.columns import CONDITIONS, QUANTITIES, Empty
from postproc.readers.csv.roles import HARMLESS, ROLES

SCHEMAS = Path(__file__).resolve().parents[2] / "docs" / "schemas"


def pages() -> dict[str, str | bytes]:
    """Return the pages of the reference that are made from the code."""
    cell_schema = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    cell_schema |= CellFile.model_json_schema(by_alias=True)
    return {
        "reference/commands.md": "\n".join(_commands()),
        "reference/cell.md": _cell(),
        "reference/csv.md": "\n".join(_csv()),
        "reference/json.md": "\n".join(_documents()),
        "reference/findings.md": "\n".join(_families()),
        **{
            page: "\n".join(_family(group))
            for group, (_, page) in zip(groups(), families(), strict=True)
        },
        "reference/python.md": "\n".join(_python()),
        "schemas/cell.schema.json": json.dumps(cell_schema, indent=1) + "\n",
    }


def _commands() -> Iterator[str]:
    yield "# Commands\n"
    yield "| command | what it does |\n|---|---|"
    for name, what in COMMANDS.items():
        yield f"| [`{name}`](#{name}) | {what} |"
    yield "\nEvery command has `--help`, `--json` (one object on stdout) and `--quiet`.\n"
    for name in COMMANDS:
        module = importlib.import_module(f"postproc.cli.commands.{name.replace('-', '_')}")
        yield from _command(name, module.command)


def _command(name: str, command: click.Command) -> Iterator[str]:
    context = click.Context(command, info_name=f"postproc {name}")
    yield f"\n## {name}\n\n{_plain(command.help)}\n"
    usage = " ".join(command.collect_usage_pieces(context))
    yield f"```text\npostproc {name} {usage}\n```\n"
    yield "| option | meaning |\n|---|---|"
    for parameter in command.params:
        record = parameter.get_help_record(context)
        if record is not None:
            name = record[0].replace("|", "\\|")
            yield f"| `{name}` | {_cell_text(record[1])} |"
    if command.epilog:
        lines = _plain(command.epilog).splitlines()
        yield "\nExamples:\n\n```text"
        yield from (line.strip() for line in lines if not line.startswith("Example"))
        yield "```"


def _plain(text: str | None) -> str:
    return (text or "").replace("\b", "").strip()


def _cell_text(text: str) -> str:
    return re.sub(r"([|\[\]])", r"\\\1", " ".join(text.split()))


def _cell() -> str:
    head, rest = cell_reference().split("## Top level", 1)
    schema = (
        "For completion and checks in an editor, the keys are also a JSON schema: "
        "[cell.schema.json](../schemas/cell.schema.json). Editors that know Taplo take it from a "
        "first line `#:schema cell.schema.json` of the cell file.\n\n"
    )
    return f"{head}{schema}## Top level{rest}"


_EMPTY = {
    Empty.ERROR: "required in every row",
    Empty.COLUMN: "all rows or none",
    Empty.BETWEEN: "between the rows around; in most rows: none",
    Empty.PART: "not measured",
    Empty.ZERO: "empty means 0",
}


def _csv() -> Iterator[str]:
    yield "# CSV columns\n"
    yield "UTF-8. Columns may stand in any order.\n"
    yield "## Points and holes of a CAM file\n"
    yield (
        "Separator `,` `;` tab or blank, decimal point or comma, header or none (then 3 columns "
        "are x, y, z and 6 are x, y, z, i, j, k, a further one the speed in mm/s). Names count "
        "without case, blanks, accents and unit; a unit may stand in brackets or behind the name "
        "(`X [mm]`, `depth_in`, `feed mm/s`, `rx (rad)`, `Drehzahl [1/min]`). Without one, lengths "
        "are mm, angles degrees, feeds mm/min, speeds of the spindle 1/min and times s. "
        "A column that is not understood stops the job by its name: `--columns` says what it is, "
        "`--accept-words` that it is harmless.\n"
    )
    yield "| column | meaning | also read as |\n|---|---|---|"
    for role in ROLES:
        others = ", ".join(f"`{other}`" for other in role.names.split() if other != role.name)
        needed = ", ".join(f"`{other}`" for other in role.unit_needed.split())
        others += f"; only beside a unit {needed}" if needed else ""
        yield f"| `{role.name}` | {_cell_text(role.meaning)} | {_cell_text(others)} |"
    harmless = ", ".join(f"`{name}`" for name in sorted(HARMLESS))
    yield f"\nColumns that are left out, for they change nothing of the motion: {harmless}.\n"
    yield "\n## Measurements\n"
    yield (
        "What `diagnose`, `identify` and `predict` read: separator `,` `;` or tab, decimals with a "
        "point, or all with a comma, header row, `#` begins a remark. Unknown columns are kept and "
        "offered as conditions that may explain the gap.\n"
    )
    yield "| column | meaning | empty |\n|---|---|---|"
    yield "| `id` | name of the row | numbered |"
    yield "| `group` | rows that were taken together; cross-validation keeps them whole | none |"
    yield "| `station` | set-up of the measuring device, with its own frame | one, of the file |"
    yield "| `reflector` | what it sees, each with its own place on the tool | one |"
    yield "| `from_id` | unknown point that a length is measured from | known, or no length |"
    yield "| `plane` | unknown plane that the tool point touched | none |"
    for name, meaning in CONDITIONS.items():
        yield f"| `{name}` | {meaning} | not logged |"
    for quantity in QUANTITIES:
        names = ", ".join(f"`{name}`" for name in quantity.names)
        yield f"| {names} | {quantity.meaning} | {_EMPTY[quantity.empty]} |"
    yield "\n## Pinned spins\n"
    yield "| column | meaning |\n|---|---|"
    yield "| `tag` | id of the tag in the CAM file, else its index from 0 |"
    yield "| `spin_deg` | angle about the tool axis that it must have |"


def _documents() -> Iterator[str]:
    yield "# JSON documents\n"
    yield (
        "What `--json` prints, and what lands in files. Each has a JSON schema (2020-12) that the "
        "tests hold real output against. A later version may add keys; a key keeps its name, unit "
        "and meaning as long as the number behind the slash stays.\n"
    )
    for path in sorted(SCHEMAS.glob("*.json")):
        schema = json.loads(path.read_text(encoding="utf-8"))
        yield f"\n## {schema['title']}\n"
        yield f"{schema['description']} Schema: [{path.name}](../schemas/{path.name}).\n"
        yield "| key | type | meaning |\n|---|---|---|"
        yield from _keys(schema, schema, "")


def _keys(schema: dict[str, Any], root: dict[str, Any], prefix: str) -> Iterator[str]:
    for key, raw in schema.get("properties", {}).items():
        entry = _resolved(raw, root)
        inner, mark = entry, ""
        while "items" in inner:
            inner, mark = _resolved(inner["items"], root), f"{mark}[]"
        name = f"{prefix}{key}{mark}"
        yield f"| `{name}` | {_type(entry, root)} | {_cell_text(entry.get('description', ''))} |"
        yield from _keys(inner, root, f"{name}.")


def _resolved(schema: dict[str, Any], root: dict[str, Any]) -> dict[str, Any]:
    if "$ref" not in schema:
        return schema
    found: dict[str, Any] = root["$defs"][schema["$ref"].rsplit("/", 1)[1]]
    return found | {key: value for key, value in schema.items() if key != "$ref"}


def _type(schema: dict[str, Any], root: dict[str, Any]) -> str:
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return " or ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    if "items" in schema:
        return f"list of {_type(_resolved(schema['items'], root), root)}"
    kinds = schema.get("type", "anything")
    return " or ".join([kinds] if isinstance(kinds, str) else kinds)


def families() -> list[tuple[str, str]]:
    """Return title and page of each family of findings."""
    return [
        (f"{group.prefix}: {group.about}", f"reference/findings/{group.prefix.lower()}.md")
        for group in groups()
    ]


def _families() -> Iterator[str]:
    yield "# Finding codes\n"
    yield "The same texts as `postproc explain CODE`. A code keeps its meaning for ever.\n"
    yield "| codes | about | entries |\n|---|---|---|"
    for group, (_, page) in zip(groups(), families(), strict=True):
        link = f"[{group.prefix}]({page.removeprefix('reference/')})"
        yield f"| {link} | {_markdown(group.about)} | {len(group.entries)} |"


def _family(group: Group) -> Iterator[str]:
    yield f"# {group.prefix}: {group.about}\n"
    for entry in group.entries:
        yield from _finding(entry)


def _finding(entry: Entry) -> Iterator[str]:
    yield f"\n## {entry.code} {{ #{entry.code} }}\n"
    severity = f" ({entry.severity})" if entry.severity else ""
    yield f"**{entry.title}**{severity}\n"
    yield f"Cause: {_markdown(entry.cause)}\n"
    yield f"Remedy: {_markdown(entry.remedy)}\n"


def _markdown(text: str) -> str:
    """Return plain text whose signs mean nothing in Markdown."""
    for sign in "\\`*_[]<>|#":
        text = text.replace(sign, f"\\{sign}" if sign not in "<>" else f"&{'lg'[sign == '>']}t;")
    return text


def _python() -> Iterator[str]:
    yield "# Python names\n"
    yield (
        "`import postproc as pp` offers these names; anything else may change. Files and arguments "
        "with a unit in their name are in that unit; arrays of `Plan` and `ToolPath` are SI.\n"
    )
    yield "```python"
    yield "import postproc as pp"
    yield "```\n"
    for name in sorted(set(postproc.__all__) - {"__version__"}, key=str.lower):
        thing = getattr(postproc, name)
        yield f"\n::: {thing.__module__}.{thing.__qualname__}\n"
