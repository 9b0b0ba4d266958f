"""Simulated readings against the model: oblique surfaces and edges under every cone: ``python benchmarks/cones.py``."""

from __future__ import annotations

import numpy as np
from common import Table

from tanteo.sensors import error_model
from tanteo.sensors.emission import draw_units, emit
from tanteo.sensors.noise import blend, cone_rays, draw_aims, edge_bias
from tanteo.sensors.presets import sensor_presets

READINGS = 200_000


def oblique(preset, incidence, rng):
    """Return standard deviation and mean of simulated ranges to an oblique plane, relative to those of the model."""
    model = error_model(preset)
    d = 0.5 * (preset.min_range + preset.max_range)
    aims = draw_aims(rng, model.beam_half_angle, (READINGS,))
    normal = np.array([np.sin(incidence), 0, np.cos(incidence)])
    true = d * np.cos(incidence) / (aims @ normal)
    calm = draw_units(np.random.default_rng(0), model)
    calm = type(calm)(0 * calm.bias, 0 * calm.scale, calm.T_hand_sensors)
    # one incidence for all: this is about the cone, not about the limit
    r, _ = emit(rng, model, calm, true, incidence, aims)
    r = r[np.isfinite(r)]
    expected = np.hypot(float(preset.law.sigma(d)), 0.5 * d * preset.beam_half_angle * np.tan(incidence))
    return r.std() / expected, (r.mean() - d) / d


def table_of_planes():
    rng = np.random.default_rng(0)
    columns = ("sensor", "half angle deg", "sd at 0 deg", "at 20 deg", "at the limit", "its deg", "mean there")
    text = "Standard deviation of simulated readings over the model's, and the mean off the range, in the middle of it."
    table = Table("Oblique surfaces", text, columns, [])
    for preset in sensor_presets().values():
        if preset.is_contact:
            continue
        some = [oblique(preset, beta, rng) for beta in (0.0, np.deg2rad(20), preset.max_incidence)]
        table.rows.append(
            (
                preset.name, f"{np.degrees(preset.beam_half_angle):.3g}", *(f"{sd:.3f}" for sd, _ in some),
                f"{np.degrees(preset.max_incidence):.0f}", f"{100 * some[-1][1]:+.1f} %",
            )
        )  # fmt: skip
    return table


def table_of_edges():
    """Return a table of an edge at 40 mm under a cone of 5 degrees, crossed by 4000 rays."""
    d, gamma = 0.04, np.deg2rad(5)
    rays, x = cone_rays(gamma, 4000), np.linspace(-1.1, 1.1, 8801) * d * np.tan(gamma)
    ranges = d / rays[:, 2]
    text = "Where a cone of 5 degrees loses an edge 40 mm away, from the part's middle outwards, beyond the true edge."
    table = Table("Edges", text, ("share of the spot that is enough", "rays mm", "d tan(gamma) g mm"), [])
    for threshold in (0.1, 0.25, 0.5, 0.75, 0.9):
        _, share = blend(np.where(x[:, None] + d * rays[:, 0] <= 0, ranges, np.inf), threshold=threshold)
        event = x[share >= threshold].max()
        table.rows.append(
            (f"{threshold:g}", f"{1e3 * event:+.2f}", f"{-1e3 * float(edge_bias(d, gamma, threshold)):+.2f}")
        )
    return table


if __name__ == "__main__":
    for one in (table_of_planes(), table_of_edges()):
        print(one.markdown(), end="\n\n")
