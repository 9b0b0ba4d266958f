"""What ``tanteo sensor`` does: read, call the public functions, print."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tanteo.cli.options import MisuseError, misuse
from tanteo.cli.printing import complain, emit, printable, put
from tanteo.cli.targets import check_different, check_target, writing
from tanteo.errors import InputError
from tanteo.sensors import RobotPreset, SensorPreset, robot_presets, sensor_preset, sensor_presets

if TYPE_CHECKING:
    from tanteo.calibration import Calibration
    from tanteo.sensors import Rig

_UNDECIDED = 3


@dataclass(frozen=True, slots=True)
class FitRequest:
    """What ``sensor fit`` was asked: files and names as they were typed."""

    log: str
    rig: str | None
    sensor: str | None
    robot: str | None
    write: str | None
    picture: str | None


def list_presets(*, as_json: bool) -> None:
    """Print the presets of sensors and robots, and the rigs that come along."""
    from tanteo.io import shipped_rigs

    if as_json:
        _print_json(
            {
                "schema": "tanteo.sensors/1",
                "sensors": [asdict(p) for p in sensor_presets().values()],
                "robots": [asdict(p) for p in robot_presets().values()],
                "rigs": list(shipped_rigs()),
            }
        )
        return
    from tanteo.cli.sensor_text import list_lines

    emit(list_lines(sensor_presets(), robot_presets(), shipped_rigs()))


def show_preset(name: str, picture: str | None, *, as_json: bool) -> None:
    """Print one sensor or robot, and draw a sensor."""
    preset = _preset(name)
    if picture is not None:
        if isinstance(preset, RobotPreset):
            raise MisuseError(f"--picture: expected a range sensor, got the robot '{name}'. Leave it out.")
        from tanteo.pictures import noise_picture

        _draw(lambda: noise_picture(preset, picture), picture)
    if as_json:
        _print_json({"schema": "tanteo.sensor/1", **asdict(preset)})
        return
    from tanteo.cli.sensor_text import robot_lines, sensor_lines

    emit(robot_lines(preset) if isinstance(preset, RobotPreset) else sensor_lines(preset))
    _say_drawn(picture)


def _preset(name: str) -> SensorPreset | RobotPreset:
    if name in robot_presets():
        return robot_presets()[name]
    try:
        return sensor_preset(name)
    except InputError as error:
        raise MisuseError(str(error).replace("sensor:", "NAME:", 1)) from None


def show_rig(file: str, *, as_json: bool) -> None:
    """Check a rig and print it."""
    from tanteo.cli.running import asked_rig

    rig = asked_rig(file)
    if as_json:
        from tanteo.io import rig_document

        _print_json(rig_document(rig))
        return
    from tanteo.cli.sensor_text import rig_lines

    emit(rig_lines(rig, file))


def run_fit(request: FitRequest, *, as_json: bool, verbose: bool) -> None:
    """Calibrate, print, write, draw; exits with 3 when the log does not tell where a beam is."""
    from tanteo.calibration import calibrate
    from tanteo.cli.running import asked_rig
    from tanteo.io import read_readings
    from tanteo.sensors import robot_preset

    check_target("--write", request.write)
    check_target("--picture", request.picture)
    check_different(("--write", request.write), ("--picture", request.picture), inputs=[("the log", request.log)])
    check_different(("--picture", request.picture), inputs=[("--rig", request.rig)])
    with misuse():
        sensor = None if request.sensor is None else sensor_preset(request.sensor)
        robot = None if request.robot is None else robot_preset(request.robot)
    rig = None if request.rig is None else asked_rig(request.rig)
    readings = read_readings(request.log)
    with misuse():
        found = calibrate(readings, rig=rig, sensor=sensor, robot=robot)
    if request.write is not None and found.status == "calibrated":
        _write(found, rig, sensor, request)
    if request.picture is not None:
        _draw_coverage(found, request.picture)
    if as_json:
        from tanteo.io import calibration_document

        _print_json(calibration_document(found))
        if found.status != "calibrated":
            emit([f"{found.status}: {printable(found.message)}"], sys.stderr)
    else:
        from tanteo.cli.fit_text import fit_lines

        emit(fit_lines(found, verbose=verbose))
        if request.write is not None and found.status == "calibrated":
            emit([f"rig written: {printable(request.write)}"])
        _say_drawn(request.picture)
    if found.status != "calibrated":
        if request.write is not None:
            complain("warning", f"{request.write} was not written: this log does not make a rig.")
        raise typer.Exit(_UNDECIDED)


def _write(found: Calibration, rig: Rig | None, sensor: SensorPreset | None, request: FitRequest) -> None:
    from tanteo.calibration import calibrated_rig
    from tanteo.io import write_rig

    assert request.write is not None
    comment = (
        f"Calibrated by `tanteo sensor fit` from {Path(request.log).name}: {int(found.good.sum())} places.\n"
        "The offset of the ranges is in the position; noise is that of single readings."
    )
    with writing("--write", request.write):
        write_rig(calibrated_rig(found, rig=rig, sensor=sensor), request.write, comment=comment)


def _draw_coverage(found: Calibration, picture: str) -> None:
    from tanteo.pictures import coverage_picture

    _draw(lambda: coverage_picture(found, picture), picture)


def _draw(draw: Callable[[], None], picture: str) -> None:
    """Draw; a picture that cannot be is the caller's option."""
    with writing("--picture", picture), misuse():
        draw()


def _say_drawn(picture: str | None) -> None:
    if picture is not None:
        emit([f"picture drawn: {printable(picture)}"])


def _print_json(document: dict[str, Any]) -> None:
    put(json.dumps(_finite(document), indent=2, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    """JSON has no NaN and no infinity: a number that is not finite is ``null``."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
