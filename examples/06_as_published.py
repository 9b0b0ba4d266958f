"""Compare the published test of parallelism (1991) with the corrected one.

The paper tests two planes for parallelism by the cosine of their angle (its (22), (23)). At a true match the cosine is
at its maximum and has no first-order variance, so the test accepts almost everything. The corrected test uses two
tilts. ``docs/paper.md`` has all equations, with the measured effect of each correction.

    python examples/06_as_published.py
"""

from pathlib import Path

import numpy as np

import tanteo
from tanteo.features import chi2_limit, chi2_statistic, parallel_planes
from tanteo.features.constraints import published
from tanteo.features.kinds import PLANE
from tanteo.geometry import SE3

rng = np.random.default_rng(6)
DRAWS, SD = 20_000, 4e-3  # of each tilt [rad]
P = np.diag([1e-8, SD**2, SD**2])
C = np.broadcast_to(PLANE.B.T @ P @ PLANE.B, (DRAWS, 6, 6))


def drawn(tilt):
    """Return sensed frames of a plane whose true tilt about x is ``tilt`` [rad]."""
    noise = rng.normal(size=(DRAWS, 3)) * np.sqrt(P.diagonal())
    return SE3.exp(np.array([0, 0, 0.02, tilt, 0, 0])) @ SE3.exp(noise @ PLANE.B)


for tilt in (0.0, 4 * SD * np.sqrt(2)):
    T1, T2 = drawn(0.0), drawn(tilt)
    cosine, _ = published.parallel_planes(T1, C, T2, C)
    with np.errstate(divide="ignore"):
        old = (cosine.value - 1) ** 2 / cosine.variance > chi2_limit(0.05, 1)
    new = parallel_planes(T1, C, T2, C)
    d2 = chi2_statistic(new.tilt, new.tilt_covariance)
    print(f"tilted by {1e3 * tilt:4.1f} mrad, tests at 5 %: rejected as published {old.mean():6.2%}, "
          f"corrected {(d2 > chi2_limit(0.05, 2)).mean():6.2%}")  # fmt: skip

HERE = Path(__file__).parent
parts = tanteo.read_parts(HERE / "parts").parts
for name in ("bracket_left", "bracket_right"):  # angles and distances cannot discriminate a part from its mirror image
    for as_published in (True, False):
        readings = tanteo.read_readings(HERE / "readings" / f"{name}.csv")
        answer = tanteo.identify(readings, parts, as_published=as_published)
        print(f"{name}, {'as published' if as_published else 'corrected'}: {answer.status}. {answer.message}")
