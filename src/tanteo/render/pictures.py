"""Diagrams of sensors by Matplotlib (extra ``plot``): noise over range and incidence, and coverage of a calibration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo.errors import InputError, MissingExtraError, install_command
from tanteo.geometry.typing import FloatArray
from tanteo.replaced import replaced
from tanteo.sensors.presets import SensorPreset

if TYPE_CHECKING:
    from tanteo.sensors.calibration import Calibration

_SUFFIXES = (".png", ".svg", ".pdf")
_INK, _RED, _GREY = "#22303c", "#b84800", "#5c6873"
COLORS = ("#0072b2", "#e69f00", "#2dae5b", "#7d12d9", "#6ec3ff", "#602404")
"""Colours of the live page, which colour-blind people can discriminate."""

_MM = 1e3


def noise_picture(preset: SensorPreset, path: str | Path) -> None:
    """Draw the noise of a range sensor over range and incidence, and the constant errors of a unit.

    Args:
        preset: sensor preset with ranges.
        path: PNG, SVG or PDF file; replaced if it exists.

    Raises:
        MissingExtraError: Matplotlib is not installed.
        InputError: the preset is a touch probe, or the suffix of the file is not supported.
        OSError: The file cannot be written.
    """
    if preset.is_contact:
        raise InputError(f"preset: expected a range sensor, got the touch probe '{preset.name}'. Name a range sensor.")
    figure = make_figure(10, 4.2)
    from matplotlib.ticker import LogLocator

    d = np.linspace(max(preset.min_range, 1e-3 * preset.max_range), preset.max_range, 300)
    left, right = figure.subplots(1, 2)
    for i, beta in enumerate(np.linspace(0, preset.max_incidence, 3)):
        label = f"noise at {np.degrees(beta):.0f} deg"
        left.plot(_MM * d, _MM * range_sd(preset, d, beta), color=COLORS[i], label=label)
    unit = np.hypot(preset.bias_std, preset.bias_prop_std * d)
    left.plot(_MM * d, _MM * unit, color=_GREY, ls="--", label="unit (bias and scale)")
    left.set(xlabel="range [mm]", ylabel="one standard deviation [mm]", yscale="log", title=preset.name)
    left.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    left.yaxis.set_major_formatter("{x:g}")
    left.minorticks_off()
    left.grid(True, alpha=0.3)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=4, frameon=False)
    angles = np.linspace(0, preset.max_incidence, 120)
    sds = _MM * range_sd(preset, d[:, None], angles)
    levels = np.geomspace(sds.min(), sds.max() * 1.0001, 13)
    shaded = right.contourf(_MM * d, np.degrees(angles), sds.T, levels=levels, cmap="viridis", norm="log")
    bar = figure.colorbar(shaded, ax=right, label="noise, one standard deviation [mm]")
    bar.set_ticks(levels[::3], labels=[f"{level:.3g}" for level in levels[::3]])
    bar.minorticks_off()
    right.set(xlabel="range [mm]", ylabel="incidence [deg]", title="beam on a flat surface")
    save_figure(figure, path)


def range_sd(preset: SensorPreset, d: FloatArray, incidence: FloatArray | float) -> FloatArray:
    """Return the standard deviation of a range to a plane, from the noise along the beam and the cone at incidence [m].

    Args:
        preset: sensor preset with ranges.
        d: ranges ``(*batch,)`` [m].
        incidence: angle between beam and surface normal ``(*batch,)`` [rad].
    """
    cone = 0.5 * d * preset.beam_half_angle * np.tan(incidence)
    return np.hypot(preset.law.sigma(d), cone)


def coverage_picture(found: Calibration, path: str | Path) -> None:
    """Draw the ranges and incidences of the readings of a calibration, and their residuals.

    Args:
        found: calibration.
        path: PNG, SVG or PDF file; replaced if it exists.

    Raises:
        MissingExtraError: Matplotlib is not installed.
        InputError: the suffix of the file is not supported.
        OSError: The file cannot be written.
    """
    figure = make_figure(10, 4.2)
    left, right = figure.subplots(1, 2)
    for k, beam in enumerate(found.beams):
        mine = found.log.beam == k
        good, bad = mine & found.good, mine & ~found.good
        d, angle, off = _MM * found.ranges, np.degrees(found.incidences), _MM * found.residuals
        hue = COLORS[k % len(COLORS)]
        left.scatter(d[good], angle[good], s=18, color=hue, label=beam.name)
        left.scatter(d[bad], angle[bad], s=40, color=_RED, marker="x")
        right.errorbar(d[good], off[good], yerr=2 * _MM * found.sds[good], fmt="o", ms=3.5, lw=0.8, color=hue)
        # far outliers would flatten everything else: they are drawn at the border
        edge = 1.3 * float(np.max(np.abs(off[found.good]) + 2 * _MM * found.sds[found.good]))
        right.scatter(d[bad], np.clip(off[bad], -edge, edge), s=40, color=_RED, marker="x")
    if not found.good.all():
        left.scatter([], [], s=40, color=_RED, marker="x", label="excluded; on the right at the border if outside")
    right.axhline(0, color=_INK, lw=0.8)
    left.set(xlabel="range [mm]", ylabel="incidence [deg]", title="ranges and incidences of the readings")
    right.set(xlabel="range [mm]", ylabel="reading minus expected [mm], bars 2 sd", title="residuals")
    left.set_ylim(bottom=0)
    for axes in (left, right):
        axes.grid(True, alpha=0.3)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=6, frameon=False)
    save_figure(figure, path)


def make_figure(width: float, height: float) -> Any:
    """Return an empty figure.

    Args:
        width: width [inches].
        height: height [inches].

    Raises:
        MissingExtraError: Matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError(
            f"picture: expected Matplotlib, got none installed. Install it: {install_command('plot')}."
        ) from None
    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def save_figure(figure: Any, path: str | Path) -> None:
    """Write a figure as PNG, SVG or PDF; a failure leaves no partial file.

    Args:
        figure: figure of Matplotlib.
        path: PNG, SVG or PDF file; replaced if it exists.

    Raises:
        InputError: the suffix of the file is not supported.
        OSError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in _SUFFIXES:
        raise InputError(f"picture: expected a file name that ends in {', '.join(_SUFFIXES)}, got '{path.name}'.")
    with replaced(path) as file:
        figure.savefig(file)
