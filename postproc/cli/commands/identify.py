"""``postproc identify``: joint stiffness from measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc identify measured.csv --cell cell.toml -o model.toml
  postproc identify measured.csv --cell cell.toml -o model.toml --grid 150 --report stiffness.html
""")
@click.argument("source", metavar="MEAS.csv")
@cli.CELL
@cli.TOOL
@cli.option("-o, --output MODEL.toml", "Model to write.", required=True)
@cli.option(
    "--method",
    "Kind of model; default: auto (smallest held-out error), or grid with --grid.",
    ("auto", "constant", "grid", "continuous"),
)
@cli.option("--grid MM", "One stiffness per cell of this edge [mm].", cli.NUMBER)
@cli.option(
    "--origin X Y Z", "Lowest corner of the grid [mm]; default: of the tool points.", cli.NUMBER
)
@cli.option(
    "--between-cells",
    "Interpolate between cell centres, or average on faces only (the paper's rule).",
    ("blend", "average"),
    default="blend",
)
@cli.option("--confidence", "Of the intervals, 0.5 to 0.999.", cli.NUMBER, default=0.9)
@cli.option("--register", "Fit the tracker's frame and the reflector first.")
@cli.option("--report FILE.html", "Write a page with figures.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Identify joint stiffness from readings with and without load.

    Readings of one posture under different loads are compared with each other, so geometry errors
    cancel. Joints that the loads cannot show are left out and named, with the load that would
    show them. Without --method and --grid the kind of model is chosen by its error on tags that
    it has not seen.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.jobs.identify import identify
    from postproc.model import save_model

    cell = load_cell(options["cell"])
    with session.progress() as progress:
        job = identify(
            options["source"],
            cell,
            grid_mm=options["grid"],
            origin_mm=options["origin"],
            blend=options["between_cells"] == "blend",
            tool=options["tool"],
            **{name: options[name] for name in ("method", "confidence", "register")},
            progress=progress,
        )
    contents = {Path(options["output"]): save_model(job.model)}
    if options["report"]:
        contents[Path(options["report"])] = job.page()
    write_files(contents)
    session.document(job.document)
    _summary(session, job.document, options)
    for text in job.warnings:
        session.say(f"warning: {text}")
    return cli.answer(good=True)


def _summary(session: cli.Session, content: dict[str, Any], options: dict[str, Any]) -> None:
    session.show(f"model    {options['output']}: {content['method']} ({content['reason']})")
    session.show(
        f"loads    move the tool {content['deflection_mm']['mean']:.4f} mm on average, "
        f"noise {content['noise_mm']:.4f} mm per axis"
    )
    for model in content["models"]:
        session.show(
            f"error    {model['name']}: mean {model['held_out_mean_mm']:.4f} max "
            f"{model['held_out_max_mm']:.4f} mm on tags not fitted"
        )
    for joint in content["joints"]:
        k, (low, high) = joint["stiffness_Nmm_per_rad"], joint["stiffness_ci_Nmm_per_rad"]
        value = "-" if k is None else f"{k:.3e} Nmm/rad"
        upper = "inf" if high is None else f"{high:.2e}"
        span = "" if low is None else f" [{low:.2e}, {upper}]"
        session.show(f"A{joint['joint']}       {value}{span} {joint['status']}")
    if options["report"]:
        session.show(f"page     {options['report']}")
