"""Stances point along their beams, clearance follows exact distances, and paths keep it or are refused."""

from __future__ import annotations

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.hand.motion import Rules
from tanteo.parts import signed_distance
from tanteo.planning import at_place, begin, hand_probe
from tanteo.planning.candidates import propose
from tanteo.planning.execution import (
    FreeSpace,
    PossiblePoses,
    approach_path,
    approach_poses,
    reachable,
    retreated_poses,
    route,
)

RULES = Rules(clearance=0.012, workspace=Workspace.above(0.0))
LYING = SE3.from_parts(np.eye(3), [0.0, 0.0, 0.03])


def believed(targets, sd=0.005):
    return begin(at_place(targets, LYING, np.diag(np.repeat([sd, min(10 * sd, 3.0)], 3)) ** 2))


def exact_gap(body, possible, T):
    """Least distance of the body from all that is possible, by the mesh."""
    centres = body.placed(T)
    return min(
        float((signed_distance(possible.targets[k].surface, SE3.apply(SE3.inverse(P), centres))[0] - body.radii).min())
        for k, P in zip(possible.part, possible.Ts, strict=True)
    )


def test_a_stance_has_a_frontal_sensor_on_the_beam():
    rng, hand = np.random.default_rng(1), gripper()
    origins, directions = rng.normal(size=(7, 3)), rng.normal(size=(7, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    Ts = approach_poses(hand, origins, directions)
    half = Ts.shape[1] // 2
    for n, sensor in enumerate(hand.frontal):
        T = Ts[:, n * half : (n + 1) * half] @ hand.rig.sensors[sensor].T_hand_sensor
        np.testing.assert_allclose(T[..., :3, 3], np.broadcast_to(origins[:, None], (*T.shape[:2], 3)), atol=1e-12)
        np.testing.assert_allclose(T[..., :3, 2], np.broadcast_to(directions[:, None], (*T.shape[:2], 3)), atol=1e-12)
    assert np.ptp(Ts[0, :half, :3, 0], axis=0).max() > 1  # all the way round


def test_distances_are_those_of_the_meshes_or_a_bit_less(targets):
    possible = PossiblePoses.of(believed(targets))
    points = np.random.default_rng(2).uniform(-0.15, 0.15, (300, 3))
    exact = np.min(
        [
            signed_distance(targets[k].surface, SE3.apply(SE3.inverse(T), points))[0]
            for k, T in zip(possible.part, possible.Ts, strict=True)
        ],
        axis=0,
    )
    got = possible.distances(points)
    step = max(t.field.step for t in targets)
    assert (got <= exact + 0.2 * step).all()
    near = exact < 0.03  # farther away than the grid reaches, it may be less
    assert near.sum() > 30
    assert (got >= exact - 1.5 * step)[near].all()


def test_before_the_first_reading_every_part_is_possible(targets):
    possible = PossiblePoses.of(believed(targets))
    assert set(possible.part.tolist()) == {0, 1, 2}
    spread = possible.Ts[possible.part == 0][:, :3, 3]
    assert np.std(spread, axis=0).min() > 1e-3
    assert possible.top() > 0.05


def test_what_is_reachable_keeps_the_whole_hand_clear(targets):
    hand, state = gripper(), believed(targets)
    probe = hand_probe(hand, RULES, 0.04)
    candidates = propose(state, probe, 120, anywhere=False)
    able = reachable(hand, RULES, probe.retreat)(state, candidates)
    assert 0 < able.sum() < len(candidates)
    possible = PossiblePoses.of(state)
    space = FreeSpace(hand.body, RULES.workspace, possible, RULES.clearance)
    for k in np.flatnonzero(able)[:5]:
        Ts = approach_poses(hand, candidates.origins[k][None], candidates.directions[k][None])[0]
        fit = Ts[space.allows(Ts) & space.allows(retreated_poses(Ts, probe.retreat))]
        assert len(fit)
        assert exact_gap(hand.body, possible, fit[0]) > RULES.clearance - 1e-3
        assert RULES.workspace.clear(hand.body, fit[0]) > RULES.clearance


def test_a_way_leads_over_obstacles_or_is_none(targets):
    hand = gripper()
    probe = hand_probe(hand, RULES, 0.04)
    down = np.diag([1.0, -1.0, -1.0])
    a, b = (SE3.from_parts(down, [x, 0.0, 0.14]) for x in (-0.2, 0.2))
    possible = PossiblePoses.of(believed(targets, 1e-4))
    space = FreeSpace(hand.body, RULES.workspace, possible, RULES.clearance)
    assert not space.along(approach_path(hand, a, b))
    stops = route(hand, space, a, b, probe.retreat)
    assert stops is not None
    np.testing.assert_array_equal(stops[-1], b)
    legs = [approach_path(hand, p, q) for p, q in zip([a, *stops], stops, strict=False)]
    assert max(T[2, 3] for leg in legs for T in leg) > 0.19
    gaps = [exact_gap(hand.body, possible, T) for leg in legs for T in leg[::3]]
    assert min(gaps) > RULES.clearance - 1e-3
    wall = ForbiddenBox("wall", [-0.02, -1, 0], [0.02, 1, 2])
    walled = FreeSpace(hand.body, Workspace.above(0.0, [wall]), possible, RULES.clearance)
    assert route(hand, walled, a, b, probe.retreat) is None


def test_from_a_narrow_place_there_is_way_out_but_not_further_in(targets):
    hand = gripper()
    possible = PossiblePoses.of(believed(targets[:1], 1e-5))
    space = FreeSpace(hand.body, RULES.workspace, possible, RULES.clearance)
    down = np.diag([1.0, -1.0, -1.0])
    heights = np.arange(0.14, 0.30, 0.002)
    stands = [SE3.from_parts(down, [0.0, 0.0, z]) for z in heights]
    gaps = np.array([exact_gap(hand.body, possible, T) for T in stands])
    narrow = stands[int(np.flatnonzero(gaps > 0.5 * RULES.clearance)[0])]
    assert not space.allows(narrow[None])[0]
    assert space.along(approach_path(hand, narrow, retreated_poses(narrow, 0.05)))
    assert not space.along(approach_path(hand, narrow, retreated_poses(narrow, -0.01)))


def test_the_probe_is_a_frontal_sensor(targets):
    hand = gripper()
    one, ten = (hand_probe(hand, RULES, 0.04, repeats=n) for n in (1, 10))
    assert float(one.law.sigma(0.04)) == pytest.approx(np.sqrt(10) * float(ten.law.sigma(0.04)))
    assert one.shared_sd > 1e-4
    assert one.max_range == pytest.approx(0.12)
    assert one.cone < np.pi / 2
    free = hand_probe(hand, Rules(clearance=0.012), 0.04)
    assert free.approach is None
    with pytest.raises(InputError, match=r"1\.25 times the clearance of 12 mm"):
        hand_probe(hand, RULES, 0.013)
    with pytest.raises(InputError, match="standoff: expected at most 120 mm"):
        hand_probe(hand, RULES, 0.2)


def test_a_part_without_a_prior_pose_raises_a_question(targets):
    """A grid of all places that it may have would not fit into memory."""
    with pytest.raises(InputError, match="expected the parts within some metres"):
        _ = PossiblePoses.of(believed(targets[:1], 2.0)).occupied
