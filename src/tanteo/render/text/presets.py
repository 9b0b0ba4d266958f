"""Sensors, robots and rigs as lines of text."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.render.text.layout import PLAIN, Layout, printable
from tanteo.sensors import Device, Rig, RigSensor
from tanteo.sensors.presets import MEANINGS, RobotPreset, SensorPreset, codes_of

_KEY = "V stated in the source, C computed from the source, M from memory, A assumed"
_COLUMNS = 6


def preset_lines(
    sensors: Mapping[str, SensorPreset],
    robots: Mapping[str, RobotPreset],
    rigs: Mapping[str, str],
    *,
    layout: Layout = PLAIN,
) -> list[str]:
    """Return tables of all presets and supplied rigs as lines of text.

    Args:
        sensors: sensor presets by name.
        robots: robot presets by name.
        rigs: texts of the supplied rig files by name.
        layout: width and style of the output.
    """
    lines = layout.table(
        ["sensor (--sensor)", "kind", "range mm", "noise mm", "verified"],
        [[p.name, p.kind, _span(p), _noise(p), p.check] for p in sensors.values()],
        left=(0, 1, 4),
    )
    lines += ["", f"verified: {_KEY}"]
    lines += [
        "",
        *layout.table(["robot (--robot)", "verified"], [[p.name, p.check] for p in robots.values()], left=(0, 1)),
    ]
    described = [[name, text.splitlines()[0].lstrip("# ")] for name, text in rigs.items()]
    return [*lines, "", *layout.table(["rig (--rig)", ""], described, left=(0, 1))]


def sensor_lines(preset: SensorPreset, *, layout: Layout = PLAIN) -> list[str]:
    """Return a sensor preset as lines of text: limits, noise by range and incidence, unit errors and sources.

    Args:
        preset: sensor preset.
        layout: width and style of the output.
    """
    lines = [layout.bold(f"{preset.name}: {preset.kind.replace('_', ' ')}")]
    if preset.is_contact:
        lines += [f"  noise      {_mm(preset.sigma_const)} mm, in every direction"]
    else:
        lines += [
            f"  range      {_span(preset)} mm, {_RANGE_KINDS[preset.range_kind]}",
            f"  beam       half angle {math.degrees(preset.beam_half_angle):.3g} deg{_SECTIONS[preset.footprint]}",
        ]
    lines += [
        *([f"  response   {_RESPONSES[preset.response]}"] if preset.response else []),
        f"  incidence  up to {math.degrees(preset.max_incidence):.3g} deg",
        f"  unit       bias {_mm(preset.bias_std)} mm, scale {100 * preset.bias_prop_std:.3g} %: constant for a device",
        f"  rate       {preset.rate_hz:g} readings a second",
        *([f"  outliers   {100 * preset.outlier_rate:g} % of readings, assumed"] if preset.outlier_rate > 0 else []),
        f"  verified   {preset.check}",
        f"             ({_KEY})",
        f"  source     {preset.source}",
    ]
    codes = [f"{value:g} {MEANINGS[meaning]}" for value, meaning in codes_of(preset.name).items()]
    lines += [f"  codes      {', '.join(codes)} [mm as written]"] if codes else []
    return lines if preset.is_contact else [*lines, "", *_noise_table(preset, layout)]


_SECTIONS = {"circle": "", "rectangle": " (a rectangle of equal section)"}
_RESPONSES = {
    "ray": "ray: the range along one random ray of the cone",
    "nearest": "nearest: the range to the nearest surface in the cone",
    "mean": "mean: the mean range over the cone",
    "strongest": "strongest: the mean range over the surface in the cone that returns most",
}

_RANGE_KINDS = {"radial": "along the beam", "perpendicular": "along the optical axis, which a rig states by axis"}


def _noise_table(preset: SensorPreset, layout: Layout) -> list[str]:
    """Return the standard deviations of a range to a plane, by range and incidence."""
    d = _grid(preset.min_range, preset.max_range)
    angles = np.linspace(0, preset.max_incidence, 4)
    cone = 0.5 * d[:, None] * preset.beam_half_angle * np.tan(angles)
    sds = np.hypot(preset.law.sigma(d)[:, None], cone)
    headers = ["noise in mm at range mm", *(f"{math.degrees(a):.3g} deg" for a in angles), "unit"]
    unit = np.hypot(preset.bias_std, preset.bias_prop_std * d)
    rows = [[f"{1e3 * r:.4g}", *map(_mm, row), _mm(u)] for r, row, u in zip(d, sds, unit, strict=True)]
    return layout.table(headers, rows)


def _grid(low: float, high: float) -> FloatArray:
    """Return the ranges to print, evenly spread over their logarithm, rounded to two digits."""
    inner = np.geomspace(max(low, 0.01 * high), high, _COLUMNS)
    rounded = [float(f"{r:.2g}") for r in inner[1:-1]]
    return np.array([inner[0], *rounded, high])


def robot_lines(preset: RobotPreset, *, layout: Layout = PLAIN) -> list[str]:
    """Return a robot preset as lines of text: repeatability, absolute error and source.

    Args:
        preset: robot preset.
        layout: width and style of the output.
    """
    return [
        layout.bold(f"{preset.name}: robot"),
        f"  repeats   to {_mm(preset.pos_repeat_std)} mm and {math.degrees(preset.rot_repeat_std):.2g} deg an axis, "
        "different at every reading",
        f"  absolute  {_mm(preset.pos_abs_std)} mm and {math.degrees(preset.rot_abs_std):.2g} deg an axis, "
        "constant during a run",
        f"  verified  {preset.check}",
        f"            ({_KEY})",
        f"  source    {preset.source}",
    ]


def rig_lines(rig: Rig, name: str, *, layout: Layout = PLAIN) -> list[str]:
    """Return the sensors of a rig as lines of text: position, direction and uncertainty.

    Args:
        rig: range sensors of a hand.
        name: name of the rig.
        layout: width and style of the output.
    """
    headers = [
        "sensor",
        "preset",
        "beam from mm",
        "along",
        "cone deg",
        "range mm",
        "noise mm",
        "mount mm",
        "deg",
        "unit mm",
    ]
    rows = [_rig_row(s) for s in rig.sensors]
    count = f"{len(rig.sensors)} sensor{'s' if len(rig.sensors) != 1 else ''}"
    return [
        layout.bold(f"{printable(name)}: {count} in the hand's frame"),
        *layout.table(headers, rows, left=(0, 1)),
        "noise: at half range; mount, unit: errors that all readings of a sensor share; all are standard deviations",
    ]


def _rig_row(sensor: RigSensor) -> list[str]:
    device = Device(sensor.name, sensor.preset, sensor)
    middle = np.asarray(0.5 * (device.min_range + np.nan_to_num(device.max_range, nan=0.2)))
    mount = np.sqrt(np.diag(sensor.cov_mount))
    T = sensor.T_hand_sensor
    unit = math.hypot(device.bias_sd, device.scale_sd * float(middle))
    return [
        sensor.name,
        sensor.preset.name if sensor.preset is not None else "",
        " ".join(f"{v + 0.0:.4g}" for v in np.round(1e3 * T[:3, 3], 3)),
        " ".join(f"{v + 0.0:.3g}" for v in np.round(T[:3, 2], 3)),
        f"{math.degrees(sensor.beam_half_angle):.3g}",
        f"{1e3 * device.min_range:.4g}-{1e3 * device.max_range:.4g}" if device.max_range > 0 else "",
        _mm(float(device.law.sigma(middle))),
        _mm(float(mount[:3].max())),
        f"{math.degrees(mount[3:].max()):.2g}",
        _mm(unit),
    ]


def _span(preset: SensorPreset) -> str:
    return "touch" if preset.is_contact else f"{1e3 * preset.min_range:.4g}-{1e3 * preset.max_range:.4g}"


def _noise(preset: SensorPreset) -> str:
    if preset.is_contact or not preset.law.depends_on_range:
        return _mm(preset.sigma_const)
    ends = np.array([max(preset.min_range, 0.01 * preset.max_range), preset.max_range])
    return "-".join(_mm(float(s)) for s in preset.law.sigma(ends))


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.3g}"
