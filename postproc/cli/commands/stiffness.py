"""``postproc stiffness``: stiffness over the rotation about the tool axis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli.common import Session, answer, read_cam, reading_options, standard_options

EPILOG = """\b
Examples:
  postproc stiffness holes.csv --cell cell.toml -o stiffness.html
  postproc stiffness part.cls --cell cell.toml --model model.toml --json
"""


@click.command(epilog=EPILOG)
@click.argument("source", metavar="INPUT")
@click.option("--cell", required=True, metavar="CELL.toml", help="The robot cell.")
@click.option("-o", "--output", metavar="FILE.html", help="Write a page with the curves.")
@click.option("--model", metavar="MODEL.toml", help="Joint stiffness of this model.")
@click.option("--tags", metavar="NAME,NAME,...", help="Names of tags; default: the key tags.")
@click.option(
    "--most", type=click.IntRange(1, 500), default=24, show_default=True, help="Key tags shown."
)
@click.option("--step", type=click.FloatRange(0.1, 90.0), help="Step [deg]; default: the cell's.")
@reading_options
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Show the stiffness index over the rotation about the tool axis, per key tag.

    True stiffness along the tool axis, across the path and across the tool axis, and the paper's
    indices kx, ky, kz, kv beside them. The best rotation is free of collision, with the whole
    stroke of a hole. Exit code 1 if a tag cannot be run at any rotation, or if the file asks for
    what convert refuses.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.planning import spin_curves
    from postproc.process import word_findings
    from postproc.units import DEG

    cell = load_cell(options["cell"])
    toolpath = read_cam(options["source"], options, cell)
    found = word_findings(toolpath)
    session.findings(found)
    cell, words = _with_model(options["model"], cell)
    curves = spin_curves(
        toolpath,
        cell,
        _tags(options["tags"], toolpath),
        None if options["step"] is None else options["step"] * DEG,
        options["most"],
    )
    if options["output"]:
        from postproc.report.pages.stiffness import stiffness_page

        write_files({Path(options["output"]): stiffness_page(curves, toolpath.name, words)})
    content = _document(curves, words)
    session.document(content)
    for tag in content["tags"]:
        best = tag["best"]["axial"]
        value = (
            "cannot be run"
            if best is None
            else (f"axial {best['N_per_mm']:.0f} N/mm at {best['spin_deg']:+.0f} deg")
        )
        session.show(f"{tag['name']:>12}  {value}")
    if curves.coaxial:
        session.say("the tool axis lies on axis 6: turning the tool changes no stiffness")
    reached = all(tag["best"]["axial"] is not None for tag in content["tags"])
    return answer(reached and not any(finding.is_error for finding in found))


def _with_model(path: str | None, cell: Any) -> tuple[Any, str]:  # noqa: ANN401 - imported lazily
    if path is None:
        return cell, "constant joint stiffness of the cell"
    from postproc.compensation import cell_with_model
    from postproc.errors import DataError, SourceRef
    from postproc.gap import stiffness_of
    from postproc.model import load_model
    from postproc.stiffness import describe

    model = load_model(path)
    field = stiffness_of(model)
    if field is None:
        raise DataError("MOD008", "the model has no joint stiffness", SourceRef(path))
    words = f"joint stiffness of {Path(path).name}: {describe(field)}"
    return cell_with_model(cell, model), words


def _tags(text: str | None, toolpath: Any) -> Any:  # noqa: ANN401 - imported lazily
    if text is None:
        return None
    import numpy as np

    from postproc.errors import DataError, SourceRef

    names = {toolpath.tag_name(i): i for i in range(len(toolpath))}
    wanted = [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in wanted if name not in names]
    if unknown or not wanted:
        raise DataError(
            "STF027",
            f"no tag is named {unknown[0] if unknown else text!r}",
            SourceRef(toolpath.path),
            hint=f"the first ones are {', '.join(list(names)[:5])}",
        )
    return np.array([names[name] for name in wanted])


def _document(curves: Any, words: str) -> dict[str, Any]:  # noqa: ANN401 - imported lazily
    import numpy as np

    from postproc.planning import INDICES, spin_degrees
    from postproc.units import N_PER_MM

    degrees = spin_degrees(curves)
    tags = []
    for row, name in enumerate(curves.names):
        best: dict[str, Any] = {}
        values: dict[str, Any] = {}
        for index in INDICES:
            at = int(curves.best(index)[row])
            k = curves.values[index][row] / N_PER_MM
            best[index] = (
                None if at < 0 else {"spin_deg": float(degrees[at]), "N_per_mm": float(k[at])}
            )
            values[index] = [float(v) if np.isfinite(v) else None for v in k]
        tags.append(
            {
                "tag": int(curves.tags[row]),
                "name": name,
                "branch": int(curves.branch[row]),
                "best": best,
                "N_per_mm": values,
                "can_be_run": (
                    np.isfinite(curves.values["axial"][row]) & ~curves.blocked[row]
                ).tolist(),
            }
        )
    return {
        "schema": "postproc.stiffness/1",
        "joint_stiffness": words,
        "coaxial": curves.coaxial,
        "spins_deg": degrees.tolist(),
        "tags": tags,
    }
