"""``tanteo sensor``: presets, rigs and calibration. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.arguments import (
    Grouped,
    Json,
    preset_names,
    robot_names,
    sensor_names,
)

sensor_app = typer.Typer(
    help="Look at sensors, robots and rigs, and calibrate them.", rich_markup_mode=None, no_args_is_help=True
)

Picture = Annotated[
    str | None, typer.Option("--picture", metavar="FILE", help="Draw it as well: a PNG, SVG or PDF file.")
]


@sensor_app.command("list", cls=Grouped)
def list_all(json: Json = False) -> None:
    """List the sensors, robots and rigs that can be named, with how far their figures were verified."""
    from tanteo.cli.running import guarded
    from tanteo.cli.sensor_running import list_presets

    with guarded():
        list_presets(as_json=json)


@sensor_app.command("show", cls=Grouped)
def show(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A sensor or a robot of `tanteo sensor list`.", autocompletion=preset_names
        ),
    ],
    picture: Picture = None,
    json: Json = False,
) -> None:
    """Show the figures of one sensor or robot: noise over range and incidence, limits, source."""
    from tanteo.cli.running import guarded
    from tanteo.cli.sensor_running import show_preset

    with guarded():
        show_preset(name, picture, as_json=json)


@sensor_app.command("rig", cls=Grouped)
def rig(
    file: Annotated[str, typer.Argument(metavar="RIG", help="Rig file (TOML), or a rig of `tanteo sensor list`.")],
    json: Json = False,
) -> None:
    """Check a rig and show where its sensors sit, where they look, and how well that is known."""
    from tanteo.cli.running import guarded
    from tanteo.cli.sensor_running import show_rig

    with guarded():
        show_rig(file, as_json=json)


@sensor_app.command("fit", cls=Grouped)
def fit(
    log: Annotated[str, typer.Argument(metavar="LOG", help="Readings (CSV): ranges of planes at many hand poses.")],
    rig: Annotated[
        str | None, typer.Option("--rig", metavar="RIG", help="Where the sensors should be; its mounting errors count.")
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option(
            "--sensor",
            metavar="NAME",
            help="Preset of sensors that the rig does not have.",
            autocompletion=sensor_names,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="PRESET",
            help="Preset with the robot's errors, for the planes.",
            autocompletion=robot_names,
        ),
    ] = None,
    write: Annotated[
        str | None, typer.Option("--write", metavar="FILE", help="Write the calibrated rig (TOML).")
    ] = None,
    picture: Picture = None,
    json: Json = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Say more.")] = False,
) -> None:
    """Estimate beams, noise and bias from readings of planes, which may be anywhere, at known poses of the hand."""
    from tanteo.cli.running import guarded
    from tanteo.cli.sensor_running import FitRequest, run_fit

    with guarded():
        run_fit(FitRequest(log, rig, sensor, robot, write, picture), as_json=json, verbose=verbose)
