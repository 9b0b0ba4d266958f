"""Rims and walls of bores as candidates of a hand: the gain about the pose and about the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bore_scenes import plate
from random_parts import write_off
from sensing_scenes import LASER, rough
from tanteo.features.kinds import feature_kind
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import begin
from tanteo.planning.candidates import propose
from tanteo.planning.context import DecisionContext
from tanteo.planning.start import at_pose
from tanteo.planning.whole import WHOLE, WholeFeature, whole_information, whole_seconds
from tanteo.posterior import prepare

RADIUS = 0.012


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    """With a bore; with a larger one; with none."""
    folder = tmp_path_factory.mktemp("plates")
    half = 0.07
    solid = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-0.02, 0.0)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip
    meshes = {"bored": plate(RADIUS), "larger": plate(RADIUS + 0.002), "solid": (solid, faces)}
    out = []
    for name, (vertices, triangles) in meshes.items():
        write_off(folder / f"{name}.off", 1e3 * vertices, triangles)
        out.append(prepare(read_part(folder / f"{name}.off", unit="mm")))
    return out


def rim(kind="circle", mode=0, T=None, place_sd=0.003):
    T = np.eye(4) if T is None else T
    return WholeFeature(kind, "rim of hole 0", mode, T, RADIUS, False, place_sd, 0.2, T[:3, 3] + 0.04 * T[:3, 2])


def context_of(state, **more):
    return DecisionContext(state, propose(state, LASER, 50), LASER, None, None, 0, 0, **more)


@pytest.mark.parametrize("kind", WHOLE)
def test_for_one_part_the_gain_is_the_ratio_of_determinants(plates, kind):
    T, C = SE3.exp(np.array([0.1, 0.2, 0.0, 0.3, 0.1, -0.2])), np.diag(np.repeat([2e-4, 1e-3], 3) ** 2)
    T_rim = T @ SE3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.4]))
    gain = whole_information([rim(kind, T=T_rim)], context_of(begin(at_pose(plates[0], T, C))))[0]
    G = SE3.adjoint_inverse(SE3.inverse(T) @ T_rim)[list(feature_kind(kind).rows)]
    after = np.linalg.inv(np.linalg.inv(C) + G.T @ (G / np.square(WHOLE[kind].sds)[:, None]))
    expected = 0.5 * (np.linalg.slogdet(C)[1] - np.linalg.slogdet(after)[1])
    assert gain == pytest.approx(0.95 * expected, rel=1e-6)


@pytest.mark.parametrize("other", [1, 2])
def test_it_decides_between_two_parts(plates, other):
    """By its radius, or by whether there is one at all."""
    targets = [plates[0], plates[other]]
    state = begin(rough(targets, sd=(2e-4, 2e-3)))
    gain = whole_information([rim()], context_of(state, part_only=True))[0]
    assert 0.5 * np.log(2) < gain < 1.2 * np.log(2)


def test_a_feature_of_both_parts_has_no_gain_about_the_part(plates):
    state = begin(rough([plates[0], plates[0]], sd=(2e-4, 2e-3)))
    part_only, open_ = (whole_information([rim()], context_of(state, part_only=yes))[0] for yes in (True, False))
    assert part_only < 0.05 * open_


def test_a_rim_that_is_too_far_off_is_none(plates):
    state = begin(rough(plates[:2], sd=(1e-5, 1e-4)))
    off = SE3.from_parts(np.eye(3), np.array([0.0, 0.03, 0.0]))
    near, far = (whole_information([rim(T=T)], context_of(state, part_only=True))[0] for T in (np.eye(4), off))
    assert far < 0.1 * near


def test_its_time_has_the_way_there(plates):
    context = context_of(begin(rough(plates[:1])))
    there = replace(context, place=np.array([0.0, 0.0, 1.04]))
    assert whole_seconds([rim()], context)[0] == WHOLE["circle"].seconds
    assert whole_seconds([rim()], there)[0] == pytest.approx(WHOLE["circle"].seconds + 1.0 / LASER.speed)
