"""Meshes for the page: small enough, still the part."""

from __future__ import annotations

import numpy as np
import trimesh

from report_scenes import ball
from tanteo.render.html import draw_part


def test_a_small_part_is_drawn_as_it_is(wedge):
    drawn = draw_part(wedge)
    assert not drawn.coarse
    assert np.array_equal(drawn.triangles, wedge.triangles)
    assert len(drawn.lines) == 12  # the edges, not the diagonals of the mesh


def test_a_large_mesh_is_made_coarser_and_stays_near_the_part(wedge):
    part = ball(wedge, subdivisions=7)
    assert len(part.triangles) > 300_000
    drawn = draw_part(part, share=4)
    assert drawn.coarse
    assert 2000 < len(drawn.triangles) <= 10_000
    assert np.abs(np.linalg.norm(drawn.vertices, axis=1) - 0.02).max() < 1e-3
    volume = trimesh.Trimesh(drawn.vertices, drawn.triangles, process=False).volume
    assert abs(volume / (4 / 3 * np.pi * 0.02**3) - 1) < 0.05
