"""Implement ``tanteo sensor``: presets, rigs and calibration."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import io, render
from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, emit, layout, leave, print_text, put_json
from tanteo.cli.readings import FileOptions, read_file
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.sensors import Rig
    from tanteo.sensors.calibration import Calibration
    from tanteo.sensors.presets import RobotPreset, SensorPreset


def _preset_names(incomplete: str) -> list[str]:
    return [*typed.sensor_names(incomplete), *typed.robot_names(incomplete)]


Picture = Annotated[str | None, args.option("--picture", "FILE", "Also draw it to a PNG, SVG or PDF file.")]


def list_presets(json: args.Json = False) -> None:
    """List the presets: sensors, robots and rigs.

    Shows how far the figures of each were verified.
    """
    from tanteo.sensors.presets import robot_presets, sensor_presets

    if json:
        document = {
            "schema": "tanteo.sensors/1",
            "sensors": [asdict(p) for p in sensor_presets().values()],
            "robots": [asdict(p) for p in robot_presets().values()],
            "rigs": list(io.documents.shipped_rigs()),
        }
        put_json(document)
    else:
        emit(render.text.preset_lines(sensor_presets(), robot_presets(), io.documents.shipped_rigs(), layout=layout()))


def show_preset(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A sensor or a robot of `tanteo sensor list`.", autocompletion=_preset_names
        ),
    ],
    picture: Picture = None,
    json: args.Json = False,
) -> None:
    """Show the figures of one sensor or robot.

    Noise over range and incidence, limits and source.
    """
    from tanteo.sensors.presets import RobotPreset

    preset = _preset(name)
    if picture is not None:
        if isinstance(preset, RobotPreset):
            raise MisuseError(f"--picture: expected a range sensor, got the robot '{name}'. Drop --picture.")
        from tanteo.render.pictures import noise_picture

        with files.writing("--picture", picture), misuse():
            noise_picture(preset, picture)
    if json:
        put_json({"schema": "tanteo.sensor/1", **asdict(preset)})
        return
    show = layout()
    emit(
        render.text.robot_lines(preset, layout=show)
        if isinstance(preset, RobotPreset)
        else render.text.sensor_lines(preset, layout=show)
    )
    if picture is not None:
        print_text(f"picture drawn: {picture}")


def _preset(name: str) -> SensorPreset | RobotPreset:
    from tanteo.sensors.presets import robot_presets, sensor_preset

    if name in robot_presets():
        return robot_presets()[name]
    try:
        return sensor_preset(name)
    except InputError as error:
        raise MisuseError(str(error).replace("sensor:", "NAME:", 1)) from None


def show_rig(
    file: Annotated[
        str,
        typer.Argument(
            metavar="RIG", help="Rig file (TOML), a rig of `tanteo sensor list`, robot.urdf#link, or a hand-eye result."
        ),
    ],
    sensor: args.Sensor = None,
    sd: args.Sd = None,
    write: Annotated[str | None, args.option("--write", "FILE", "Write the rig (TOML).")] = None,
    json: args.Json = False,
) -> None:
    """Check a rig, and show the poses of its sensors.

    Shows positions, beam directions and their uncertainties.
    """
    files.check_target("--write", write)
    rig = files.read_rig(file, sensor, sd)
    if write is not None:
        with files.writing("--write", write):
            io.write_rig(rig, write)
    if json:
        put_json(io.documents.rig_document(rig))
    else:
        emit(render.text.rig_lines(rig, file, layout=layout()))


def fit(
    log: Annotated[str, typer.Argument(metavar="LOG", help="Readings: ranges of planes at many hand poses.")],
    file: FileOptions,
    rig: Annotated[
        str | None, args.option("--rig", "RIG", "Nominal poses of the sensors with their uncertainties (TOML).")
    ] = None,
    sensor: Annotated[
        str | None,
        args.option(
            "--sensor",
            "NAME",
            "Preset for sensors of the log that the rig does not have.",
            autocompletion=typed.sensor_names,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        args.option("--robot", "PRESET", "Preset of the robot that moved the hand.", autocompletion=typed.robot_names),
    ] = None,
    units: args.Units = None,
    target: Annotated[
        str | None,
        args.option(
            "--target",
            "TARGET",
            "What all readings are on: 'plane POSE +- 0.2mm 0.1deg', 'ball 12mm@X,Y,Z +- 0.1mm', "
            "'point X,Y,Z +- 0.1mm', 'part FILE@POSE +- 0.2mm 0.1deg'.",
        ),
    ] = None,
    write: Annotated[str | None, args.option("--write", "FILE", "Write the calibrated rig (TOML).")] = None,
    picture: Picture = None,
    json: args.Json = False,
    verbose: Annotated[bool, args.option("--verbose -v", None, "Print more details.")] = False,
) -> None:
    """Calibrate a rig from readings of flat surfaces, of a known target, or at known distances.

    Estimates beams, noise and bias. Flat surfaces may be anywhere. A column true_distance_mm replaces hand poses.
    """
    from tanteo.sensors import calibrate
    from tanteo.sensors.presets import robot_preset, sensor_preset

    files.check_target("--write", write)
    files.check_target("--picture", picture)
    files.check_different(("--write", write), ("--picture", picture), inputs=[("the log", log)])
    files.check_different(("--picture", picture), inputs=[("--rig", rig)])
    with misuse():
        known = None if target is None else io.poses.parse_target(target, units, "--target")
        unlike = None if sensor is None else sensor_preset(sensor)
        errors = None if robot is None else robot_preset(robot)
    nominal = None if rig is None else files.read_rig(rig, sensor)
    readings, _ = read_file(log, file, units, nominal, sensor)
    with misuse():
        found = calibrate(readings, rig=nominal, sensor=unlike, robot=errors, target=known)
    calibrated = found.status == "calibrated"
    if write is not None and calibrated:
        with misuse():
            _write(found, nominal, unlike, log, write)
    if picture is not None:
        from tanteo.render.pictures import coverage_picture

        with files.writing("--picture", picture), misuse():
            coverage_picture(found, picture)
    if json:
        put_json(io.documents.calibration_document(found))
        if not calibrated:
            print_text(f"{found.status}: {found.message}", sys.stderr)
    else:
        emit(render.text.calibration_lines(found, verbose=verbose, layout=layout()))
        _print_written(write if calibrated else None, picture)
    if write is not None and not calibrated:
        complain("warning", f"{write} was not written: this log does not determine a rig.")
    leave(decided=calibrated)


def _print_written(rig: str | None, picture: str | None) -> None:
    if rig is not None:
        print_text(f"rig written: {rig}")
    if picture is not None:
        print_text(f"picture drawn: {picture}")


def _write(found: Calibration, rig: Rig | None, sensor: SensorPreset | None, log: str, path: str) -> None:
    from tanteo.sensors.calibration import calibrated_rig

    comment = (
        f"Calibrated by `tanteo sensor fit` from {Path(log).name}: {int(found.good.sum())} places.\n"
        "The offset of a single beam is in its position, that of a multi-zone device in bias; noise is that of single "
        "readings."
    )
    with files.writing("--write", path):
        io.write_rig(calibrated_rig(found, rig=rig, sensor=sensor), path, comment=comment)
