"""Modes around a maximum that is unlike any single density: their mass against plain importance sampling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.matching.belief import squared_gaps
from tanteo.matching.freedom import pose_scale
from tanteo.matching.priors import log_sum
from tanteo.parts import read_part
from tanteo.surface_search import identify_touches, modes, prepare_target
from tanteo.surface_search.adapted_draws import effective
from tanteo.surface_search.around import _maxima, modes_around
from tanteo.surface_search.likelihood import log_posterior

WIDE = 3.0
"""Plain draws are so many times as wide as the curvature says."""

EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def spacer():
    return prepare_target(read_part(EXAMPLES / "hex_spacer.step"))


def asked(spacer, seed, monkeypatch):
    """Arguments with which the first wide maximum of a scene is looked around; a tenth of the part is noise."""
    rng, seen = np.random.default_rng((31, seed)), []
    p, _ = surface_points(spacer, int(rng.integers(14, 25)), rng)
    touches = touches_of(SE3.apply(box_centred_pose(rng), p) + 3e-3 * rng.normal(size=p.shape), 3e-3)
    monkeypatch.setattr(modes, "modes_around", lambda *given: seen.append(given) or modes_around(*given))
    identify_touches(touches, no_paths(), [spacer], priors=Priors(radius=spacer.part.radius))
    return seen[0]


@pytest.mark.parametrize("seed", [3, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 4))])
def test_the_mass_is_that_of_plain_draws(spacer, seed, monkeypatch):
    """Several times that of the curvature; of a twelvefold symmetry it is counted once."""
    touches, free, mode, left, priors = asked(spacer, seed, monkeypatch)
    around, gone = modes_around(touches, free, mode, left, priors)
    assert mode.k in gone
    part, T, rng = spacer.part, mode.found.Ts[mode.k], np.random.default_rng(8)
    _, maxima, near = _maxima(mode, left, 9 * mode.covariance)
    L = np.linalg.cholesky(WIDE**2 * mode.covariance)
    u = rng.normal(size=(12000, 6))
    Ts = T @ SE3.exp(u @ L.T)
    owner = np.stack([_gaps(part, maxima, j, Ts) for j in range(len(maxima.Ts))]).argmin(axis=0)
    once = (
        np.trace((SE3.inverse(T) @ Ts @ part.symmetry.Ts[:, None])[..., :3, :3], axis1=2, axis2=3).argmax(axis=0) == 0
    )
    log = np.full(len(Ts), -np.inf)
    own = np.flatnonzero((owner < near) & once)
    for rows in np.array_split(own, 10):
        log[rows] = log_posterior(touches, free, Ts[rows], np.zeros((len(rows), 0)), spacer, priors)
    log += 0.5 * np.sum(u * u, axis=1) + 3 * np.log(2 * np.pi) + np.linalg.slogdet(L)[1]
    assert effective(log) > 60
    rest = mode.log_mass - mode.found.log_evidence[mode.k]
    plain = log_sum(log) - np.log(len(log)) + rest - np.linalg.slogdet(pose_scale(priors.radius, part.centroid))[1]
    assert log_sum([m.log_mass for m in around]) == pytest.approx(plain, abs=0.2)
    assert plain > mode.log_mass + 1


def _gaps(part, maxima, j, Ts):
    A = np.broadcast_to(maxima.information[j][:6, :6], (len(Ts), 6, 6))
    return squared_gaps(part, Ts, np.broadcast_to(maxima.Ts[j], Ts.shape), A) - np.linalg.slogdet(A[0])[1]
