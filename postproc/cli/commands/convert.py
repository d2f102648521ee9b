"""``postproc convert``: CAM toolpath to a checked KUKA program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli
from postproc.errors import headlines
from postproc.progress import Progress

_SPIN_MAPS = (".html", ".png", ".csv")


def _known_suffix(
    context: click.Context, parameter: click.Parameter, files: tuple[str, ...]
) -> tuple[str, ...]:
    for name in files:
        if Path(name).suffix.lower() not in _SPIN_MAPS:
            text = f"{name!r}: expected a name that ends in {', '.join(_SPIN_MAPS)}"
            raise click.BadParameter(text, context, parameter)
    return files


@cli.command("""
  postproc convert part.cls --cell cell.toml -o out
  postproc convert holes.csv --cell cell.toml -o out --strategy smooth --report out/holes.html
  postproc convert holes.csv --cell cell.toml -o out --trade
  postproc convert holes.csv --cell cell.toml -o out --spin-map map.html --spin-map map.csv
""")
@click.argument("source", metavar="INPUT")
@cli.CELL
@cli.option("-o, --output DIR", "Folder of the program.", required=True)
@cli.option("--name TEXT", "Program name; default: that of the input file.")
@cli.reading_options
@cli.planning_options
@cli.option("--trade", "Show what each preset would lose and gain.")
@cli.option("--pins FILE.csv", "Spins that tags must have: tag,spin_deg.")
@cli.option("--partial", "Write the good stretches even if tags fail.")
@cli.option("--report FILE.html", "Write a page that shows the program.")
@cli.option(
    "--spin-map FILE",
    "Write what every spin about the tool axis would mean at every tag: .html, .png or .csv; "
    "also when tags fail.",
    multiple=True,
    callback=_known_suffix,
)
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Convert a CAM toolpath to DIR/NAME.src and DIR/NAME.dat.

    Every tag gets the best pose about its tool axis; reach, limits, singularity and collisions
    are checked along the whole motion, and the written text is read back and compared with the
    CAM path. If any tag fails nothing is written and the exit code is 1.
    """
    from postproc.jobs.convert import ConvertRequest, convert, document, explained, land

    request = ConvertRequest(**cli.requested(options))
    with session.progress() as progress:
        conversion = explained(convert(request, progress), request, progress)
        maps = _spin_maps(conversion, options["spin_map"], progress)
    folder = Path(options["output"])
    contents = dict(maps)
    if options["report"]:
        from postproc.jobs.pages import page_of_conversion

        contents[Path(options["report"])] = page_of_conversion(conversion)
    removed, stay = land(conversion, folder, contents)
    for cause in conversion.causes:
        click.echo(cause.text, err=True)
    session.findings([*conversion.findings, *stay])
    content = {**document(conversion), "removed": list(removed)}
    session.document(content)
    _summary(session, conversion, content, folder)
    if removed:
        session.show(f"removed  {', '.join(removed)}: left by an earlier {conversion.name}")
    for name, path in (("page", options["report"]), *(("map", p) for p in options["spin_map"])):
        if path:
            session.show(f"{name:<8} {path}")
    return cli.answer(conversion.good)


def _nearest(clearance: dict[str, Any]) -> str:
    """Return the smallest clearance in words."""
    asked = f"asked {clearance['asked_mm']:g} mm"
    if clearance["pair"] is None:
        return f"no solid within {clearance['smallest_mm']:g} mm where the tool works, {asked}"
    one, two = clearance["pair"]
    where = f"tag {clearance['tag']} (line {clearance['line']})"
    return f"{clearance['smallest_mm']:g} mm: {one} and {two} at {where}, {asked}"


def _spin_maps(
    conversion: Any,  # noqa: ANN401 - imported lazily
    files: tuple[str, ...],
    progress: Progress,
) -> dict[Path, bytes]:
    """Return the spin map in the form of each file's suffix."""
    if not files:
        return {}
    from postproc.planning import spin_map
    from postproc.report.pages.spin_map import spin_map_page
    from postproc.report.parts import draw

    spins = spin_map(conversion.plan, conversion.cell, progress)
    forms = {
        ".html": lambda: spin_map_page(spins, conversion.cell.name),
        ".png": lambda: draw(spins).png,
        ".csv": lambda: spins.to_csv().encode(),
    }
    return {Path(name): forms[Path(name).suffix.lower()]() for name in files}


def _summary(
    session: cli.Session,
    conversion: Any,  # noqa: ANN401 - imported lazily
    content: dict[str, Any],
    folder: Path,
) -> None:
    first = [f"careful  {text}" for text in headlines(conversion.findings)]
    if content["assumed"]:
        assumed = f"assumed  {'; '.join(content['assumed'])}"
        first[:1] = [f"{first[0]}; {assumed}" if first else assumed]
    for text in first:
        session.show(text)
    if conversion.files:
        session.show(f"program  {folder / next(iter(conversion.files))}")
    else:
        count = len(content["failures"])
        session.show(f"no program: {count} error{'s' if count > 1 else ''} above")
    session.show(f"tags     {content['tags']}, controller points {content['points']}")
    if content["stiffness"]:
        figures = content["stiffness"]
        start = figures["initial_mean_N_per_mm"]
        gain = f" ({start:.0f} without rotation about the tool axis)" if start else ""
        session.show(
            f"stiffness {figures['objective']}: mean {figures['mean_N_per_mm']:.0f} N/mm{gain}, "
            f"lowest {figures['min_N_per_mm']:.0f} N/mm"
        )
    if conversion.trade:
        from postproc.jobs.trade import HEAD

        session.show("presets  (* is written)")
        for row in (HEAD, *(outcome.row() for outcome in conversion.trade)):
            session.show(f"  {row[0]:<12}" + "".join(f"{word:>10}" for word in row[1:]))
    if conversion.kept is not None:
        session.show(f"kept     {conversion.kept.text()}")
    session.show(f"cycle    {content['cycle_time_s']:.1f} s (estimate)")
    grades = ", ".join(f"{count} {grade}" for grade, count in content["grades"].items())
    session.show(f"margin   to limits, singularity and solids: {grades}")
    if content["clearance"]:
        session.show(f"nearest  {_nearest(content['clearance'])}")
