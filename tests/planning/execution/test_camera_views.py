"""The next view of a camera on the hand, mixed with beams by expected information per second."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand import Workspace
from tanteo.hand.motion import go_to
from tanteo.io import read_record, read_scene, scenes, write_record
from tanteo.io.scenes.hand_camera import HandCamera
from tanteo.parts import read_part
from tanteo.planning import Stop, sense_part
from tanteo.planning.execution import FreeSpace, PossiblePoses
from tanteo.planning.execution.camera_views import OUT_OF_REACH, TAKEN, TOO_NEAR, next_view

DEMO = resources.files("tanteo.bench.demo")


@pytest.fixture(scope="module")
def made():
    """A scene with a camera on the hand, two parts, a session, its robot and rules."""
    with resources.as_file(DEMO) as folder:
        scene = replace(read_scene(folder / "cell.toml"), arm=None)
        parts = [read_part(folder / "parts" / f"bracket_{side}.stl", unit="mm") for side in ("left", "right")]
    start, _ = scenes.start_of(scene, parts)
    session, robot, rules = scenes.session_of(scene, start, Stop(tolerance=3e-3, probability=0.99))
    return scene, start, session, robot, rules


def space_of(made, workspace=None, reach=None):
    scene, _, session, _, rules = made
    possible = PossiblePoses.of(session.state)
    return FreeSpace(scene.hand.body, workspace or rules.workspace, possible, rules.clearance, reach=reach)


class Nowhere:
    """Joints that reach no pose."""

    def reaches(self, Ts_world_hand, free=None):
        return np.zeros(len(Ts_world_hand), dtype=bool)

    def follows(self, path, free=None):
        return False


def test_views_are_excluded_with_their_reasons(made):
    scene, start, session, robot, _ = made
    eye, here = HandCamera(scene, robot, start.targets, start).eye, robot.sensed.T_world_hand

    def found(**limits):
        taken = limits.pop("taken", ())
        return next_view(session.state, scene.hand, eye, space_of(made, **limits), here, 0.2, taken)

    best = found()
    assert best.gain > 1
    assert best.seconds >= 0.5
    low = found(workspace=Workspace(np.full(3, -np.inf), np.array([np.inf, np.inf, 0.05])))
    assert low.gain == 0
    assert set(low.excluded) == {TOO_NEAR}
    assert set(found(reach=Nowhere()).excluded) <= {OUT_OF_REACH, TOO_NEAR}
    again = found(taken=[best.T_world_hand])
    assert again.excluded[TAKEN] >= 1
    assert SE3.log(SE3.inverse(again.T_world_hand) @ best.T_world_hand)[3:] @ np.ones(3) != 0


@pytest.mark.slow
def test_a_session_takes_views_with_a_reason(made):
    scene, start, session, robot, rules = made
    eyes = HandCamera(scene, robot, start.targets, start)
    done = sense_part(session, robot, rules, furniture=scenes.furniture_of(scene), errors=scene.cell.robot, eyes=eyes)
    first = done.visits[0]
    assert first.action.face == "view"
    assert "A view first" in first.note
    assert first.step is not None
    assert len(eyes.views) == sum(visit.action.acquires == "view" for visit in done.visits)
    answer = session.answer()
    assert answer.status == "recognized"
    assert answer.best.part == "bracket_left"
    assert done.end.reached
    assert scenes.least_clearance(scene, robot) > 0


@pytest.mark.slow
def test_two_views_and_their_camera_keep_the_part(made):
    """Two images agree only with an error of the camera on the hand; the prior pose does not win before it is found."""
    scene, start, *_ = made
    session, robot, rules = scenes.session_of(scene, start, Stop(tolerance=3e-3))
    made = scene, start, session, robot, rules
    eyes = HandCamera(scene, robot, start.targets, start)
    session.restart(eyes.photograph())
    here, first = robot.sensed.T_world_hand, session.state.weights[0]
    view = next_view(session.state, scene.hand, eyes.eye, space_of(made), here, 0.2, [here])
    go_to(robot, view.T_world_hand, rules)
    session.restart(eyes.photograph())
    further = next_view(
        session.state,
        scene.hand,
        eyes.eye,
        space_of(made),
        here,
        0.2,
        [here, view.T_world_hand],
        session.stop.tolerance,
    )
    assert first > 0.9
    assert session.state.weights[0] > 0.9
    assert np.sqrt(np.diag(session.state.covariances[0])[:3]).max() < 5e-3
    assert further.gain < 1  # the pose is within the goal, and no image decides whether all show another object


@pytest.mark.slow
def test_a_first_reading_keeps_the_pose_of_two_views(made):
    """Its sensor adds errors of its own; the errors of the camera, with which the images agree, stay."""
    scene, start, *_ = made
    session, robot, rules = scenes.session_of(scene, start, Stop(tolerance=1e-4, max_measurements=1))
    eyes = HandCamera(scene, robot, start.targets, start)
    session.restart(eyes.photograph())
    view = next_view(
        session.state, scene.hand, eyes.eye, space_of((scene, start, session, robot, rules)),
        robot.sensed.T_world_hand, 0.2, [robot.sensed.T_world_hand],
    )  # fmt: skip
    go_to(robot, view.T_world_hand, rules)
    session.restart(eyes.photograph())
    pose, weight = session.state.poses[0], session.state.weights[0]
    sense_part(session, robot, rules, furniture=scenes.furniture_of(scene), errors=scene.cell.robot)
    assert session.count
    assert session.state.weights[0] > min(weight, 0.9)
    assert np.linalg.norm(session.state.poses[0][:3, 3] - pose[:3, 3]) < 2e-3


@pytest.mark.slow
def test_a_record_with_views_replays(made, tmp_path):
    scene, start, *_ = made
    session, robot, _ = scenes.session_of(scene, start, Stop(tolerance=3e-3, probability=0.99))
    eyes = HandCamera(scene, robot, start.targets, start)
    eyes.photograph()
    session.restart(eyes.photograph())
    file = tmp_path / "session.json"
    write_record(session, file)
    again = read_record(file, [target.part for target in start.targets])
    images = [group for factor in again.start.factors for group in factor.groups[0]]
    mountings = {id(one.camera.mounting) for one in images if hasattr(one, "camera")}
    assert len(mountings) == 1
    np.testing.assert_allclose(again.state.poses[0], session.state.poses[0], atol=1e-6)
    np.testing.assert_allclose(again.state.weights[0], session.state.weights[0], atol=1e-6)


def test_a_scene_without_a_camera_on_the_hand_is_refused(made):
    scene, start, _, robot, _ = made
    with pytest.raises(InputError, match="wrist_camera"):
        HandCamera(replace(scene, wrist=None), robot, start.targets, start)


def test_a_restart_keeps_readings_and_parts(made):
    _, start, session, _, _ = made
    before = session.count
    session.restart(session.start)
    assert session.count == before
    other = replace(start, targets=start.targets[:1], part=start.part[:1], Ts=start.Ts[:1],
                    covariances=start.covariances[:1], weights=start.weights[:1])  # fmt: skip
    with pytest.raises(InputError, match="the parts of the session"):
        session.restart(other)
