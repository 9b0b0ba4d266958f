"""Calibrations as lines of text: beams, noise, planes, coverage and outliers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tanteo.render.text.layout import PLAIN, Layout, printable
from tanteo.words.sentences import parameter_words

if TYPE_CHECKING:
    from tanteo.geometry.typing import FloatArray
    from tanteo.sensors.calibration import BeamFit, Calibration, DeviceFit

_MOST_OUTLIERS = 12
_RANGES, _ANGLE_STEP = 6, 15.0


def calibration_lines(found: Calibration, *, verbose: bool = False, layout: Layout = PLAIN) -> list[str]:
    """Return a calibration as lines of text: beams, planes, ranges and incidences, and outliers.

    Args:
        found: calibration to print.
        verbose: whether to list all outliers.
        layout: width and style of the output.
    """
    readings = int(np.sum(found.log.station >= 0))
    planes = f"{len(found.planes)} plane{'s' if len(found.planes) > 1 else ''}" if found.planes else "the target"
    by_distances = bool(found.log.readings.true_distances.given.any())
    planes = "known distances" if by_distances else planes
    head = f"{found.status}: {readings} readings at {len(found.log)} places on {planes}"
    lines = [layout.bold(head), f"  {printable(found.message)}"]
    for k, device in enumerate(found.devices):
        first = found.beams[int(np.argmax(found.log.device == k))]
        own = _beam_lines(first, layout) if device.zones == 1 else _zone_lines(device, first, layout)
        lines += ["", *(_distance_lines(device, first, layout) if by_distances else own)]
        lines += _determined_lines(device)
    if found.target is None:
        lines += ["", *_plane_table(found, layout)]
    elif not by_distances:
        lines += ["", *_target_lines(found)]
    lines += ["", *_coverage_table(found, layout)]
    return [*lines, "", *_outlier_lines(found, verbose=verbose)]


def _beam_lines(beam: BeamFit, layout: Layout) -> list[str]:
    T, sds = beam.T_hand_beam, np.sqrt(np.diag(beam.cov))
    # standard deviations of the origin along the hand's axes; the rotation about the beam is irrelevant
    R = T[:3, :3]
    spread = np.sqrt(np.diag(R @ beam.cov[:3, :3] @ R.T))
    tilt = math.degrees(math.hypot(sds[3], sds[4]) / math.sqrt(2))
    law = beam.repeats.law
    place = _with_sd(beam.place_sds, beam.place_cov, (1e3, 100.0, math.degrees(1.0)))
    lines = [
        layout.bold(f"sensor {printable(beam.name)}, in the hand's frame"),
        f"  beam from   ({_values(1e3 * T[:3, 3], 2)}) mm, sd ({_values(1e3 * spread, 2)}) mm; "
        "the offset of the ranges is in it",
        f"  beam along  ({_values(T[:3, 2], 4)}), sd {tilt:.2g} deg about each axis across",
        f"  scale       reads {1 + beam.scale:.4f} times the range, sd {sds[5]:.2g}",
        f"  slant       reads {100 * beam.slant:+.2f} % of the range times tan^2 of the incidence more, "
        f"sd {100 * sds[6]:.2g}",
        f"  places      sd {place[0]} mm, {place[1]} % of the range, {place[2]} deg across the beam: "
        "from place to place",
    ]
    if beam.repeats.dof:
        repeats = _with_sd(np.array([law.const, law.prop]), beam.repeats.cov, (1e3, 100.0))
        lines.append(
            f"  repeats     sd {repeats[0]} mm, {repeats[1]} % of the range: from reading to reading at one place"
        )
    else:
        lines.append("  repeats     none: the line above contains the difference between readings of one place")
    return lines


def _distance_lines(device: DeviceFit, beam: BeamFit, layout: Layout) -> list[str]:
    """Return what known distances determine of a device: offset, scale and noise."""
    offset, scale, sds = device.values[0], device.values[1], np.sqrt(np.diag(device.cov))
    place = _with_sd(beam.place_sds, beam.place_cov, (1e3, 100.0, 1.0))
    return [
        layout.bold(f"sensor {printable(device.name)}"),
        f"  offset      reads {1e3 * offset:+.2f} mm, sd {1e3 * sds[6]:.2g} mm",
        f"  scale       reads {1 + scale:.4f} times the range, sd {sds[7]:.2g}",
        f"  places      sd {place[0]} mm, {place[1]} % of the range: from place to place",
    ]


def _zone_lines(device: DeviceFit, beam: BeamFit, layout: Layout) -> list[str]:
    """Return a multi-zone device, with the noise of one of its beams."""
    T, sds = device.T_hand_device, np.sqrt(np.diag(device.cov))
    offset, scale, _, field = device.values
    place = _with_sd(beam.place_sds, beam.place_cov, (1e3, 100.0, math.degrees(1.0)))
    zones = np.ptp(device.zone_offsets)
    return [
        layout.bold(f"device {printable(device.name)} of {device.zones} zones, in the hand's frame"),
        f"  from        ({_values(1e3 * T[:3, 3], 2)}) mm, sd ({_values(1e3 * sds[:3], 2)}) mm along its own axes",
        f"  axis along  ({_values(T[:3, 2], 4)}), sd ({_values(np.degrees(sds[3:6]), 2)}) deg about its own axes",
        f"  offset      reads {1e3 * offset:+.2f} mm, sd {1e3 * sds[6]:.2g} mm; zones differ by {1e3 * zones:.2g} mm",
        f"  scale       reads {1 + scale:.4f} times the range, sd {sds[7]:.2g}",
        f"  field       {100 * field:+.2f} % wider than stated, sd {100 * sds[9]:.2g} %",
        f"  places      sd {place[0]} mm, {place[1]} % of the range, {place[2]} deg across the beam: "
        "from place to place",
    ]


_QUANTITIES = (
    ("mounting", (0, 1, 2), 1e3, "mm"), ("rotation", (3, 4), math.degrees(1.0), "deg"),
    ("offset", (6,), 1e3, "mm"), ("scale", (7,), 100.0, "%"),
)  # fmt: skip


def _determined_lines(device: DeviceFit) -> list[str]:
    """Return how much the log improved each quantity, and the pose to take next."""
    before, after = np.sqrt(np.diag(device.prior)), np.sqrt(np.diag(device.cov))
    lines = []
    for name, rows, unit, word in _QUANTITIES:
        was, now = (unit * float(sds[list(rows)].max()) for sds in (before, after))
        if was < unit * 1e-5:  # one beam: its offset is in the mounting
            continue
        verdict = "determined" if now < 0.5 * was else "improved" if now < 0.9 * was else "not determined"
        lines.append(f"  {name:<11} {verdict}: sd {was:.2g} {word} before the log, {now:.2g} {word} after")
    lines += [f"  undetermined {parameter_words(one)}" for one in device.undetermined]
    return [*lines, f"  next        {device.advice}"] if device.advice else lines


def _with_sd(sds: FloatArray, cov_of_squares: FloatArray, units: Sequence[float]) -> list[str]:
    """Return standard deviations with their uncertainty, or their 95 % upper bounds."""
    out = []
    for sd, variance, unit in zip(sds, np.diag(cov_of_squares), units, strict=True):
        spread = math.sqrt(max(float(variance), 0.0))
        if math.isnan(sd):
            out.append("not determined")
        elif sd**2 > spread:
            out.append(f"{unit * sd:.3g} +- {unit * spread / (2 * sd):.1g}")
        else:
            out.append(f"below {unit * math.sqrt(sd**2 + 1.645 * spread):.2g}")
    return out


def _target_lines(found: Calibration) -> list[str]:
    target = found.target
    assert target is not None
    T, sds = target.T_world_target, np.sqrt(np.diag(target.cov))
    return [
        f"target at ({_values(1e3 * T[:3, 3], 2)}) mm, sd ({_values(1e3 * sds[:3], 2)}) mm; "
        f"rms {1e3 * target.rms:.2f} mm at {target.stations} places"
    ]


def _plane_table(found: Calibration, layout: Layout) -> list[str]:
    rows = []
    for plane in found.planes:
        sds = np.sqrt(np.diag(plane.cov))
        rows.append(
            [
                plane.name,
                str(plane.stations),
                f"{1e3 * plane.rms:.2f}",
                *(f"{v + 0.0:.4f}" for v in plane.T_world_plane[:3, 2]),
                f"{math.degrees(max(sds[:2])):.2g}",
                f"{1e3 * float(plane.T_world_plane[:3, 3] @ plane.T_world_plane[:3, 2]):.2f}",
                f"{1e3 * sds[2]:.2g}",
            ]
        )
    headers = ["plane", "places", "rms mm", "normal x", "y", "z", "sd deg", "offset mm", "sd mm"]
    return layout.table(headers, rows)


def _coverage_table(found: Calibration, layout: Layout) -> list[str]:
    """Return the number of places at each range and incidence."""
    lines = []
    for k, device in enumerate(found.devices):
        mine = (found.log.of == k) & found.good
        if not mine.any():
            continue
        d, angles = 1e3 * found.ranges[mine], np.degrees(found.incidences[mine])
        edges = np.linspace(d.min(), d.max() + 1e-9, _RANGES + 1)
        tops = np.arange(_ANGLE_STEP, angles.max() + _ANGLE_STEP, _ANGLE_STEP)
        counts = np.histogram2d(angles, d, bins=[np.r_[0.0, tops], edges])[0].astype(int)
        headers = [f"places of {device.name}", *(f"{a:.0f}-{b:.0f} mm" for a, b in pairwise(edges))]
        rows = [
            [f"{top - _ANGLE_STEP:.0f}-{top:.0f} deg", *(str(c) if c else "." for c in row)]
            for top, row in zip(tops, counts, strict=True)
        ]
        lines += layout.table(headers, rows)
    return [*lines, "The result holds for these ranges and incidences."]


def _outlier_lines(found: Calibration, *, verbose: bool) -> list[str]:
    outliers = found.outliers
    if not outliers:
        return ["No reading was excluded."]
    kinds = Counter(s.reason for s in outliers)
    lines = ["Excluded: " + ", ".join(f"{_count(n, r)}" for r, n in kinds.items())]
    shown = outliers if verbose else outliers[:_MOST_OUTLIERS]
    for s in shown:
        first, last = printable(s.ids[0]), printable(s.ids[-1])
        names = first if len(s.ids) == 1 else f"{first} .. {last} ({len(s.ids)})"
        got, expected = 1e3 * s.reading, 1e3 * s.expected
        lines.append(f"  {s.reason}: {names} on {printable(s.plane)} read {got:.1f} mm, expected {expected:.1f} mm")
    if len(shown) < len(outliers):
        lines.append(f"  ... and {len(outliers) - len(shown)} more (-v shows all)")
    return lines


def _count(n: int, reason: str) -> str:
    what = "reading" if reason == "unlike its repeats" else "place"
    return (
        f"{n} {what}{'s' if n > 1 else ''} {reason}"
        if reason != "outlier"
        else f"{n} outlier {what}{'s' if n > 1 else ''}"
    )


def _values(values: FloatArray, digits: int) -> str:
    return ", ".join(f"{v + 0.0:.{digits}f}" for v in values)
