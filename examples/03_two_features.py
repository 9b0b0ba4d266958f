"""Compute constraints between pairs of sensed features, with their variances (section 4 of the paper).

Planes, edges and vertices are fitted to the labelled readings. Every pair of features has values that do not depend on
the pose of the part: an angle, an offset, a distance. Each value has a covariance, so a chi-square test can compare it
with the model. Values that a pair does not have, such as the angle of parallel planes, are listed with the reason.

    python examples/03_two_features.py
"""

from pathlib import Path

import numpy as np

import tanteo
from tanteo.features import chi2_limit, relate_all
from tanteo.fitting import fit_labelled
from tanteo.sensors import measure

HERE = Path(__file__).parent
readings = tanteo.read_readings(HERE / "readings" / "bracket_left.csv")
sensed = fit_labelled(measure(readings))
for feature in sensed.features:
    height, tilt = 1e3 * np.sqrt(feature.P[0, 0]), 1e3 * np.sqrt(feature.P[1:, 1:].diagonal())
    print(f"{feature.label:17} sd of height {height:.3f} mm, of tilts {tilt[0]:.2f} and {tilt[1]:.2f} mrad")

table = relate_all(sensed.features)
print(f"{len(table)} constraints")
for c in table:
    if c.kind.null and c.p_value() < 1e-4:
        continue  # tilts of a pair that is not parallel
    scale, unit = (1e3, "mm") if c.kind.units == ("m",) else (np.degrees(1), "deg")
    value, sd = scale * c.value, scale * np.sqrt(c.covariance.diagonal())
    print(f"{' & '.join(c.labels):32} {c.kind.name:17} {np.round(value, 3)} +- {np.round(sd, 3)} {unit}")
for gap in table.absent()[:2]:
    print(f"no {gap.kind.name} of {' & '.join(gap.labels)}: {gap.reason}")

thickness = next(c for c in table if c.kind.name == "plane_offset")  # minus the thickness of the upright
for model in (-0.0120, -0.0125):
    d2, limit = float(thickness.distance2(model)), float(chi2_limit(0.05, 1))
    verdict = "possible" if d2 <= limit else "rejected"
    print(f"upright {-1e3 * model:g} mm thick: squared distance {d2:.2f}, limit {limit:.2f}: {verdict}")
