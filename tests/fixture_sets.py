"""Touches of one unmoved fixture by two people with an uncertain tip: the sets, and how far two poses agree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.stats import chi2

import tanteo
from tanteo.factors import FreeRays, as_contact_points
from tanteo.geometry import SE3
from tanteo.posterior import Priors, Problem, identify_points, prepare
from tanteo.posterior.update import posterior_about
from tanteo.sensors import measure

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "fixture_touches"
SETS = "novice", "expert"
SD, TIP = 0.3e-3, (1.5e-3, 1.5e-3, 0.3e-3)
"""Repeatability, and the tip's offset: sideways and along [m]."""


def fixture():
    """Return the part, prepared."""
    return prepare(tanteo.read_part(FOLDER / "fixture.stl", unit="mm"))


def touches_of(name, tip=TIP):
    measured = measure(tanteo.read_readings(FOLDER / f"{name}.csv"), sd=SD, tip_sd=tip)
    return as_contact_points(measured), measured.shared


def locate_sets(target):
    """Answer by set and by whether the tip's error is stated."""
    out = {}
    for name in SETS:
        for tip in (TIP, None):
            touches, shared = touches_of(name, tip)
            out[name, tip is not None] = identify_points(touches, FreeRays.none(), [target], shared=shared)
    return out


def errors(target, located, name, tip):
    """Pose, and how its error depends on the readings' noise ``(6, 6)`` and on the whitened tip ``(6, D)``.

    The estimate has error ``-A^-1 (J' e + [0; z])``: ``z`` is the draw that its prior took for zero.
    """
    h = located[name, tip].hypotheses[0]
    touches, _ = touches_of(name, TIP if tip else None)
    mode = mode_at(target, touches, h.T_world_part)
    covariance = np.linalg.inv(mode.information)
    return mode.T_peak, covariance[:6, :6], covariance[:6, 6:]


def mode_at(target, touches, T):
    """Return the mode that a maximization from a pose reaches."""
    problem = Problem(touches, FreeRays.none(), Priors(radius=target.part.radius, noise_factor=1.0))
    return posterior_about(problem, target, T[None], np.random.default_rng(0)).modes[0]


def disagreement(target, located, tip, *, one_draw):
    """P-value of the difference of the two poses, with one tip in both sets or with a tip for each."""
    (T, P, G), (U, Q, H) = (errors(target, located, name, tip) for name in SETS)
    xi = SE3.log(SE3.inverse(T) @ U)
    A = SE3.adjoint(SE3.inverse(U) @ T)  # errors of the first pose, seen from the second
    cross = A @ G @ H.T if one_draw else np.zeros((6, 6))
    joint = A @ P @ A.T + Q - cross - cross.T
    assert np.linalg.eigvalsh(joint).min() > 0
    return float(chi2.sf(xi @ np.linalg.solve(joint, xi), 6))
