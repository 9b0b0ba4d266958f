"""Readings of one place, line or face, of any noise and with any prior, have an answer of finite numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.posterior import Priors

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "block", "flange", "hex_spacer", "t_slot"


@pytest.fixture(scope="module")
def parts():
    return [tanteo.read_part(PARTS / f"{name}.step") for name in NAMES]


def places(part, kind, n, rng):
    """Return points ``(n, 3)`` of the surface of a part, or of less of it."""
    triangles = part.triangles[rng.integers(len(part.triangles), size=n)]
    if kind == "one face":
        own = np.flatnonzero(part.triangle_face == rng.choice(part.triangle_face))
        triangles = part.triangles[rng.choice(own, n)]
    p = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), n), part.vertices[triangles])
    return {
        "line": p[:1] + np.linspace(0, 1, n)[:, None] * (p[-1:] - p[:1]),
        "cluster": p[:1] + 1e-4 * rng.normal(size=p.shape),
        "repeated": p[rng.integers(min(n, 3), size=n)],
        "lattice": np.round(p, 2),
        "vertices": part.vertices[rng.integers(len(part.vertices), size=n)],
        "anywhere": 0.2 * rng.normal(size=p.shape),
    }.get(kind, p)


KINDS = "surface", "one face", "line", "cluster", "repeated", "lattice", "vertices", "anywhere"


def scene(parts, seed):
    """Return readings, their part, and priors, all drawn from the seed."""
    rng = np.random.default_rng(seed)
    part, n = parts[rng.integers(len(parts))], int(rng.choice([1, 2, 3, 4, 6, 8, 12]))
    p, sd, columns = places(part, rng.choice(KINDS), n, rng), 10.0 ** rng.uniform(-9, -1.5), {}
    if rng.random() < 0.5:
        sd = 10.0 ** rng.uniform(-5, -3)
        p = p + sd * rng.normal(size=p.shape)
    towards = rng.normal(size=p.shape)
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    if rng.random() < 0.3:
        columns["directions"] = towards
    elif rng.random() < 0.3:
        columns["normals"], columns["normal_sds"] = towards, np.full(n, 10.0 ** rng.uniform(-6, 0))
    if rng.random() < 0.3:
        columns["features"] = [part.faces[k].name for k in rng.integers(len(part.faces), size=n)]
    p = p + rng.choice([0.0, 1.0, 1e3, 1e5]) * np.array([1.0, -2.0, 0.005])
    rates = {
        "unknown": [1e-6, 0.05, 0.5, 0.999],
        "outlier_rate": [1e-9, 0.02, 0.5, 0.9],
        "noise_factor": [1.0, 1.001, 2.0, 10.0],
    }
    priors = Priors(**{name: float(rng.choice(values)) for name, values in rates.items()})
    return tanteo.Readings.from_columns(p, sds=np.full(n, sd), **columns), part, priors


@pytest.mark.quick_sets(8)
@pytest.mark.parametrize("seed", [*range(16), *(pytest.param(k, marks=pytest.mark.slow) for k in range(16, 120))])
def test_any_readings_have_an_answer_or_a_sentence(parts, seed):
    readings, part, priors = scene(parts, seed)
    try:
        answer = tanteo.identify(readings, [part], priors=priors, conventions=False)
    except tanteo.InputError:
        return
    assert 0 <= answer.unknown_probability <= 1
    for one in answer.hypotheses:
        assert 0 <= one.probability <= 1
        assert np.isfinite(one.T_world_part).all()
        values = np.linalg.eigvalsh(one.covariance)
        assert values.min() > -1e-9 * values.max()
