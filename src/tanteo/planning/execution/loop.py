"""Execution of a session with a hand, which moves to each action without contact, reads at rest, and updates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, Transforms
from tanteo.hand import Hand, Robot
from tanteo.hand.acquisition import SENSE
from tanteo.hand.motion import Motion, Rules, go_to
from tanteo.hand.simulator.arm import Reach
from tanteo.planning.candidates import Candidates
from tanteo.planning.execution.approach import approach_poses, feasible, ranked, route
from tanteo.planning.execution.camera_views import Eyes, next_view
from tanteo.planning.execution.possible import FreeSpace, PossiblePoses
from tanteo.planning.execution.resting import Furniture, as_readings, beyond_furniture, of_parts, rest
from tanteo.planning.execution.start import REPEATS
from tanteo.planning.execution.whole import guess_of, readings_of, standoff_of
from tanteo.planning.session.action import Action
from tanteo.planning.session.conversation import Session
from tanteo.planning.session.values import Done, Step
from tanteo.planning.state import SensingState
from tanteo.sensors.presets import RobotPreset
from tanteo.words import Finding, message_of
from tanteo.words.findings import BeamsFree, FurnitureHit, NoClearPath, NoEcho, NothingToAcquire, ViewFirst

_TRIED = 4
"""Largest number of approach poses of a beam to which a path is planned."""

_REFUSED = 25
"""Number of successive actions without a reading after which the run ends."""

_LEAST_VIEW = 0.1
"""Smallest expected information of a view that is taken [nats]: a view with less repeats what is known."""

_TRAVEL = 2.5
"""Speed between waypoints in free space, as a multiple of the speed of the rules."""


@dataclass(frozen=True, slots=True, eq=False)
class Visit:
    """One action of the session and its result.

    Attributes:
        action: action that the session proposed.
        motions: motions of the hand, in order.
        step: posterior after the readings; None without readings.
        leader: name of the most probable part after the action; empty if no part explains the readings.
        findings: remarks for the user, such as why a motion failed.
        seconds: time since the start of the run [s].
        travel: path length of the hand's front since the start of the run [m].
    """

    action: Action
    motions: tuple[Motion, ...]
    step: Step | None
    leader: str
    findings: tuple[Finding, ...]
    seconds: float
    travel: float

    @property
    def note(self) -> str:
        """Text of the remarks; empty without any."""
        return message_of(self.findings)


@dataclass(frozen=True, slots=True, eq=False)
class Executed:
    """Result of a complete run.

    Attributes:
        end: reason for the end of the run.
        visits: all actions and their results, in order.
    """

    end: Done
    visits: tuple[Visit, ...]

    @property
    def seconds(self) -> float:
        """Return the duration of the run [s]."""
        return self.visits[-1].seconds if self.visits else 0.0

    @property
    def travel(self) -> float:
        """Return the path length of the hand's front [m]."""
        return self.visits[-1].travel if self.visits else 0.0


def reachable(
    hand: Hand, rules: Rules, retreat: float, reach: Reach | None = None
) -> Callable[[SensingState, Candidates], BoolArray]:
    """Return a function that flags the candidates in reach of a hand, for :attr:`tanteo.planning.Session.able`.

    Args:
        hand: sensors and body of the hand.
        rules: limits of the hand's motions.
        retreat: length of the straight final approach [m].
        reach: joints that carry the hand; None for a hand that can be everywhere.
    """

    def able(state: SensingState, candidates: Candidates) -> BoolArray:
        space = FreeSpace(hand.body, rules.workspace, PossiblePoses.of(state), rules.clearance, reach=reach)
        return feasible(hand, space, candidates, retreat)

    return able


def sense_part(
    session: Session,
    robot: Robot,
    rules: Rules,
    *,
    furniture: Furniture | None = None,
    errors: RobotPreset | None = None,
    reach: Reach | None = None,
    eyes: Eyes | None = None,
    watch: Callable[[Visit], None] = lambda visit: None,
) -> Executed:
    """Sense a part with a hand until the session ends.

    The session's probe models one frontal sensor. Where the hand rests, both frontal sensors are read. If a motion ends
    early, the readings there are used, and the session does not choose that action again.

    Args:
        session: posterior and planner. Set ``able`` to :func:`reachable` and ``whole`` to :func:`acquirable`.
        robot: robot that carries the hand.
        rules: limits of the hand's motions.
        furniture: known solids of the cell; a beam that hits one is a free-space ray that ends before it.
        errors: error model of the robot's reported poses; None for exact poses.
        reach: joints that carry the hand; None for a hand that can be everywhere.
        eyes: camera on the hand, whose views are taken if they have more expected information per second; None without.
        watch: function to call after every action.

    Returns:
        Reason for the end, and all actions with their results.
    """
    run, began = _Run(session, robot, rules, furniture, errors, reach, eyes), robot.sensed.time
    visits, in_vain, gone = list[Visit](), 0, 0.0
    while isinstance(action := session.ask(), Action):
        if (view := run.view_before(action)) is not None:
            action = view.action
            motions, step, findings = run.take(view)
        else:
            motions, step, findings = run.answer(action)
        for motion in motions:
            fronts = SE3.apply(np.array([sensed.T_world_hand for sensed in motion.log]), robot.hand.front)
            gone += float(np.linalg.norm(np.diff(fronts, axis=0), axis=1).sum())
        leader = session.state.target(0).part.name if len(session.state.weights) else ""
        visits.append(Visit(action, motions, step, leader, findings, robot.sensed.time - began, gone))
        watch(visits[-1])
        in_vain = in_vain + 1 if visits[-1].step is None else 0
        if in_vain >= _REFUSED:
            action = Done(False, (NoClearPath("hand", last=True),))
            break
    return Executed(action, tuple(visits))


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """Pose of the hand for a view, and the view as an action."""

    T_world_hand: Transforms
    action: Action


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    session: Session
    robot: Robot
    rules: Rules
    furniture: Furniture | None
    errors: RobotPreset | None
    reach: Reach | None
    eyes: Eyes | None
    taken: list[Transforms] = field(default_factory=list)

    def view_before(self, action: Action) -> _View | None:
        """Return the view that is worth more per second than an action; None if there is none."""
        if self.eyes is None or not np.isfinite(action.gain):
            return None
        session, hand, here = self.session, self.robot.hand, self.robot.sensed.T_world_hand
        possible, speed = PossiblePoses.of(session.state), _TRAVEL * self.rules.speed
        space = FreeSpace(hand.body, self.rules.workspace, possible, self.rules.clearance, reach=self.reach)
        left = session.stop.left_for_noise(session.state)
        found = next_view(
            session.state, hand, self.eyes.eye, space, here, speed, self.taken, left, session.stop.feature
        )
        front = SE3.apply(here, hand.front)
        seconds = session.probe.seconds + float(np.linalg.norm(action.origin - front)) / speed
        if found.gain < _LEAST_VIEW or found.gain / found.seconds <= action.gain / seconds:
            return None
        reason = ViewFirst(found.gain, found.seconds, action.gain, seconds, tuple(sorted(found.excluded.items())))
        T = self.eyes.eye.camera_at(found.T_world_hand).T_world_camera
        assert T is not None
        leader = session.state.target(0).part
        away = float(np.linalg.norm(SE3.apply(session.state.poses[0], leader.centroid) - T[:3, 3]))
        named = replace(
            action, origin=T[:3, 3], direction=T[:3, 2], max_range=away, expected=away, part=leader.name, face="view",
            gain=found.gain, reason=reason, radius=0.0, acquires="view",
        )  # fmt: skip
        return _View(found.T_world_hand, named)

    def take(self, view: _View) -> tuple[tuple[Motion, ...], Step | None, tuple[Finding, ...]]:
        """Move to a view, take the image and restart the session with it."""
        assert self.eyes is not None
        self.taken.append(view.T_world_hand)
        hand, here = self.robot.hand, self.robot.sensed.T_world_hand
        possible = PossiblePoses.of(self.session.state)
        space = FreeSpace(hand.body, self.rules.workspace, possible, self.rules.clearance, reach=self.reach)
        stops = route(hand, space, here, view.T_world_hand, 0.0)
        if stops is None:
            return (), None, (NoClearPath("hand"),)
        motions = self._go(stops)
        if not motions[-1].reached:
            return motions, None, (motions[-1].finding,)
        return motions, self.session.restart(self.eyes.photograph()), (view.action.reason,)

    def answer(self, action: Action) -> tuple[tuple[Motion, ...], Step | None, tuple[Finding, ...]]:
        """Move, read and update the session; return the motions, the update and remarks for the user."""
        stops = self._waypoints(action)
        if stops is None:
            self.session.refuse(action)
            return (), None, (NoClearPath("hand"),)
        motions = self._go(stops)
        if action.acquires:
            return self._acquire(action, motions)
        failed = () if motions[-1].reached else (motions[-1].finding,)
        step, remarks = self._read(action)
        if (
            failed or step is None or remarks or not step.ids
        ):  # without new information the session would choose the action again
            self.session.refuse(action)
        return motions, step, (*failed, *remarks)

    def _acquire(
        self, action: Action, motions: tuple[Motion, ...]
    ) -> tuple[tuple[Motion, ...], Step | None, tuple[Finding, ...]]:
        """Acquire a whole feature and report its readings; report nothing if the acquisition fails."""
        guess = guess_of(self.session.state, action)
        if guess is None or not motions[-1].reached:
            self.session.refuse(action)
            return motions, None, (NothingToAcquire() if motions[-1].reached else motions[-1].finding,)
        got = SENSE[action.acquires](
            self.robot, guess, standoff=standoff_of(self.rules), rules=self.rules, label=action.name, errors=self.errors
        )
        motions += got.motions
        if not got.acquired:
            self.session.refuse(action)
            return motions, None, (got.finding,)
        return motions, self.session.tell(readings_of(got), action), (got.finding,)

    def _waypoints(self, action: Action) -> list[Transforms] | None:
        hand, session, here = self.robot.hand, self.session, self.robot.sensed.T_world_hand
        possible = PossiblePoses.of(session.state)
        space = FreeSpace(hand.body, self.rules.workspace, possible, self.rules.clearance, reach=self.reach)
        probe = session.probe
        Ts = approach_poses(hand, action.origin[None], action.direction[None])[0]
        Ts = Ts[space.allows(Ts)]
        Ts = Ts[space.reaches(Ts)]
        if not len(Ts):
            return None
        routes = (
            route(hand, space, here, T, probe.retreat)
            for T in ranked(hand, session.state, Ts, here, probe.max_range)[:_TRIED]
        )
        return next((stops for stops in routes if stops is not None), None)

    def _go(self, stops: list[Transforms]) -> tuple[Motion, ...]:
        fast = replace(self.rules, speed=_TRAVEL * self.rules.speed)
        motions = list[Motion]()
        for k, stop in enumerate(stops):
            motions.append(go_to(self.robot, stop, self.rules if k == len(stops) - 1 else fast))
            if not motions[-1].reached:
                break
        return tuple(motions)

    def _read(self, action: Action) -> tuple[Step | None, tuple[Finding, ...]]:
        """Read at rest and update the session; return the update and remarks on unusual readings."""
        hand = self.robot.hand
        readings = as_readings(hand, rest(self.robot, REPEATS), str(action.number))
        readings = None if readings is None else of_parts(hand, readings, PossiblePoses.of(self.session.state))
        if readings is None:
            return None, (NoEcho(),)
        remarks: tuple[Finding, ...] = ()
        if self.furniture is not None:
            of_it = self.furniture.hit(readings, hand.rig, self.errors, self.session.state)
            readings = beyond_furniture(readings, of_it, hand.rig)
            remarks = (FurnitureHit(int(of_it.sum())),) if of_it.any() else ()
        if readings.is_free.all():
            remarks = (*remarks, BeamsFree())
        return self.session.tell(readings, action), remarks
