"""The commands and their options. Only the parser is imported here: everything else waits for its command."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.arguments import (
    AsPublished,
    BoxAt,
    Grouped,
    Json,
    OutlierRate,
    PartPath,
    PartPaths,
    PosePriorAt,
    PriorPath,
    ReadingsPath,
    Report,
    RigPath,
    Robot,
    Sd,
    Seed,
    Sensor,
    Significance,
    TableAt,
    TipSd,
    Tolerance,
    Top,
    Units,
    UnknownPrior,
    Verbose,
)
from tanteo.cli.demo import demo
from tanteo.cli.plan_app import plan
from tanteo.cli.replay import replay
from tanteo.cli.sense_app import sense_app
from tanteo.cli.sensor_app import sensor_app
from tanteo.cli.view_app import view

app = typer.Typer(
    help="Which part is it, where is it, and how sure are we: from touches and ranges against CAD files.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    epilog="Exit codes: 0 answered, 1 failed, 2 misused, 3 ambiguous, unknown or insufficient.",
)
part_app = typer.Typer(help="Look at CAD files.", rich_markup_mode=None, no_args_is_help=True)


def _version(wanted: bool) -> None:
    if wanted:
        from tanteo import __version__

        typer.echo(f"tanteo {__version__}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Which part is it, where is it, and how sure are we: from touches and ranges against CAD files."""


@app.command(cls=Grouped)
def identify(
    readings: ReadingsPath,
    parts: PartPaths,
    units: Units = None,
    sensor: Sensor = None,
    sd: Sd = None,
    tolerance: Tolerance = "0mm",
    robot: Robot = None,
    tip_sd: TipSd = None,
    outlier_rate: OutlierRate = None,
    unknown_prior: UnknownPrior = None,
    rig: RigPath = None,
    table: TableAt = None,
    box: BoxAt = None,
    pose_prior: PosePriorAt = None,
    prior: PriorPath = None,
    significance: Significance = 0.01,
    top: Top = 5,
    as_published: AsPublished = False,
    report: Report = None,
    json: Json = False,
    seed: Seed = 0,
    verbose: Verbose = False,
) -> None:
    """Say which of the parts was sensed, where it is and how sure that is."""
    from tanteo.cli.options import misuse, read_options
    from tanteo.cli.prior_options import read_pose_prior
    from tanteo.cli.running import guarded, recognize

    with guarded():
        with misuse():
            options = read_options(
                units=units, sensor=sensor, robot=robot, sd=sd, tolerance=tolerance, tip_sd=tip_sd,
                outlier_rate=outlier_rate, unknown_prior=unknown_prior, significance=significance, top=top,
                as_published=as_published, seed=seed,
            )  # fmt: skip
        pose = read_pose_prior(table, box, pose_prior, prior)
        recognize(readings, parts, rig, options, pose, report=report, as_json=json, verbose=verbose)


@app.command(cls=Grouped)
def locate(
    readings: ReadingsPath,
    part: PartPath,
    units: Units = None,
    sensor: Sensor = None,
    sd: Sd = None,
    tolerance: Tolerance = "0mm",
    robot: Robot = None,
    tip_sd: TipSd = None,
    outlier_rate: OutlierRate = None,
    unknown_prior: UnknownPrior = None,
    rig: RigPath = None,
    table: TableAt = None,
    box: BoxAt = None,
    pose_prior: PosePriorAt = None,
    prior: PriorPath = None,
    significance: Significance = 0.01,
    top: Top = 5,
    as_published: AsPublished = False,
    report: Report = None,
    json: Json = False,
    seed: Seed = 0,
    verbose: Verbose = False,
) -> None:
    """Say where a known part is and how sure that is."""
    from tanteo.cli.running import guarded, require_file

    with guarded():
        require_file("--part", part)
    identify(
        readings, [part], units, sensor, sd, tolerance, robot, tip_sd, outlier_rate, unknown_prior, rig, table,
        box, pose_prior, prior,
        significance, top, as_published, report, json, seed, verbose,
    )  # fmt: skip


@app.command(cls=Grouped)
def see(
    image: Annotated[str, typer.Argument(metavar="IMAGE", help="Image file (PNG, JPEG, ...).")],
    camera: Annotated[
        str, typer.Option("--camera", metavar="FILE", help="Calibration file of OpenCV or ROS (YAML, JSON).")
    ],
    parts: PartPaths,
    units: Units = None,
    marks: Annotated[
        str | None,
        typer.Option("--marks", metavar="FILE", help="Known points of the table, to place the camera (CSV)."),
    ] = None,
    picture: Annotated[
        str | None, typer.Option("--picture", metavar="FILE", help="Draw what was seen to this file (PNG).")
    ] = None,
    top: Top = 5,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Say which parts an image shows and where they are: on a table, or one part anywhere."""
    from tanteo.cli.options import misuse, read_top, read_unit
    from tanteo.cli.running import guarded

    with guarded():
        with misuse():
            unit, count = None if units is None else read_unit(units), read_top(top)
        from tanteo.cli.seeing import SeeOptions, see_image

        see_image(SeeOptions(image, camera, parts, unit, marks, picture, count), as_json=json, verbose=verbose)


app.command(cls=Grouped)(plan)
app.add_typer(sense_app, name="sense")
app.command(cls=Grouped)(view)
app.command(cls=Grouped)(replay)


@part_app.command("show", cls=Grouped)
def show(
    file: Annotated[str, typer.Argument(metavar="FILE", help="CAD file (STEP, STL, ...).")],
    units: Units = None,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Show what was read: planes, edges, vertices, curved faces, symmetry, box and repairs."""
    from tanteo.cli.options import misuse, read_unit
    from tanteo.cli.running import guarded, show_part

    with guarded():
        with misuse():
            unit = None if units is None else read_unit(units)
        show_part(file, unit, as_json=json, verbose=verbose)


app.add_typer(sensor_app, name="sensor")
app.add_typer(part_app, name="part")
app.command(cls=Grouped)(demo)


@app.command(cls=Grouped)
def doctor(json: Json = False) -> None:
    """Say what is installed and whether it works: versions, extras, a self-test."""
    from tanteo.cli.doctoring import run_doctor
    from tanteo.cli.running import guarded

    with guarded():
        run_doctor(as_json=json)
