"""Recognizing and locating a part among the examples from a few sensed planes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from common import Table, seconds

from tanteo.features import Feature
from tanteo.features.kinds import PLANE
from tanteo.geometry import SE3
from tanteo.parts import Part, read_part
from tanteo.posterior import identify_features, prepare

PARTS = Path(__file__).parents[1] / "examples" / "parts"
SD = np.array([1e-4, 2e-3, 2e-3])
"""Standard deviations of a sensed plane: height [m] and the two tilts [rad]."""

TEXT = """\
`tanteo.posterior.identify_features` on planes sensed on one of the example parts, against all, prepared beforehand:
search, samples, pose with covariance. The planes are drawn at random from the part's own, heights with a standard
deviation of 0.1 mm and tilts of 2 mrad; each part is sensed once for every number of planes. "True part first" counts
the scenes whose most probable hypothesis is the part that was sensed; with few planes others may truly fit as well."""


def sense(part: Part, count: int, rng: np.random.Generator, among: np.ndarray | None = None) -> list[Feature]:
    """Planes of a part (of some of them) at a random pose, with errors from the covariance that they state."""
    T_world_part = SE3.exp(np.concatenate([rng.uniform(-0.3, 0.3, size=3), rng.normal(size=3)]))
    features = []
    planes = np.arange(len(part.planes)) if among is None else among
    for k in rng.choice(planes, size=min(count, len(planes)), replace=False):
        error = SE3.exp(PLANE.B.T @ (SD * rng.normal(size=3)))
        T = T_world_part @ part.planes.Ts_part_feature[k] @ error
        x, y = 0.5 * part.planes.gyration[k]
        patch = np.array([[x, y, 0], [-x, y, 0], [-x, -y, 0], [x, -y, 0]])
        features.append(Feature(PLANE, T, np.diag(SD**2), label=f"plane {k}", support=SE3.apply(T, patch)))
    return features


def measure() -> Table:
    parts = [read_part(path) for path in sorted(PARTS.glob("*.step"))]
    models = [prepare(part) for part in parts]
    rows = []
    for count in (3, 4, 5, 6, 8):
        rng = np.random.default_rng(count)
        times, right = [], 0
        for part in parts:
            features = sense(part, count, rng)
            answer = identify_features(features, models)
            right += bool(answer.hypotheses) and answer.hypotheses[0].part == part.name
            times.append(
                seconds(lambda features=features: identify_features(features, models), repeats=3, at_least=1e-3)
            )
        assert right >= len(parts) // 3, f"{count} planes: the true part came first in {right} of {len(parts)} scenes"
        worst = parts[int(np.argmax(times))].name
        rows.append(
            (
                str(count),
                f"{right} of {len(parts)}",
                f"{np.median(times) * 1e3:.3g}",
                f"{np.max(times) * 1e3:.3g} ({worst})",
            )
        )
    columns = ("planes sensed", "true part first", "milliseconds, median", "milliseconds, worst")
    return Table(f"Identifying one of {len(parts)} parts", TEXT, columns, rows)
