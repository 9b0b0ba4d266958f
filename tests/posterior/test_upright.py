"""The equivalent pose with z up and the least turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface
from tanteo.posterior.symmetry import upright

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.mark.parametrize("name", ["hex_spacer", "square_post", "bracket_left"])
def test_an_upright_pose_is_equivalent_and_no_worse(name):
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / f"{name}.step")
    surface = Surface(part.vertices, part.triangles)
    for w in np.random.default_rng(5).normal(size=(6, 3)):
        T = SE3.from_parts(SO3.exp(w), np.array([0.4, 0.2, 0.1]))
        S = upright(part, T)
        assert surface.closest(SE3.apply(S, part.vertices)).distances.max() < 1e-6
        images = T @ part.symmetry.Ts
        assert (T @ S)[2, 2] >= images[:, 2, 2].max() - 1e-3
        level = images[images[:, 2, 2] >= images[:, 2, 2].max() - 1e-3]
        assert np.trace((T @ S)[:3, :3]) >= np.trace(level[:, :3, :3], axis1=1, axis2=2).max() - 1e-9


def test_a_spacer_upside_down_is_written_upright():
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / "hex_spacer.step")
    T = SE3.from_parts(SO3.exp(np.array([np.pi, 0.0, 0.0])), np.zeros(3))
    assert np.allclose((T @ upright(part, T))[:3, :3], np.eye(3), atol=1e-6)
