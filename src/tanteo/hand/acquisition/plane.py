"""Acquire a face: scan the surroundings, choose a patch, move over it, descend and scan it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.features import Feature
from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.guesses import FaceGuess
from tanteo.hand.acquisition.patch import Patch, find_patches, stands
from tanteo.hand.acquisition.run import Acquired, Attempt, SensingRun, back_off, failed, finish
from tanteo.hand.acquisition.scan import ALONG, WIDTHS, scan
from tanteo.hand.acquisition.seen import beside, cloud_of, over
from tanteo.hand.acquisition.ways import come_near, facing, fits, known, moved, scan_surroundings
from tanteo.hand.motion.following import approach
from tanteo.hand.motion.steering import Motion, Rules
from tanteo.hand.motion.travelling import go_to, path
from tanteo.hand.robot import Robot
from tanteo.sensors import error_model
from tanteo.sensors.presets import RobotPreset
from tanteo.words.findings import FaceNotRepeated, FacesTooNarrow, Finding, NoFlatFace, NoSpace, NotAllSeen, OtherFace

HOVER = 0.06
"""Height above the stand-off before the descent [m]."""

_HIGHER, _IN_REACH = 0.075, 0.8
"""Height above the stand-off for a scan of unknown surroundings [m], and its bound as a fraction of the frontal
sensors' range. From there the beams cover the space that the fingers sweep farther down."""

_BELOW = 0.3
"""Distance of the descent beyond the expected face, as a fraction of the stand-off."""

SCANS = ((0.25, 0.09), *(((0.22, 0.05),) * 9))
"""Tilt of the hand's axis at the end of each spiral scan, and its increase from turn to turn [rad]."""


_ELSEWHERE = 0.008
"""Smallest distance of a new position from those that failed [m]."""

_NARROW = FacesTooNarrow()
_NO_CLEARANCE = NoSpace("over the face")
_UNSEEN = NotAllSeen("over the face")
_UNSURE: Attempt = ("unclear", FaceNotRepeated(), None)


_ASTRAY = np.radians(12.0)
"""Angle between the normal of a patch and its guess above which the hand scans again from above [rad]."""

_WIDE = 0.004
"""Smallest clearance around both sensors on a patch [m]."""


_OTHER = 5.0
"""Deviation from the guess, in standard deviations, beyond which a face is another one."""


@dataclass(frozen=True, slots=True)
class Tried:
    """Record of failed scans.

    Attributes:
        patches: patches whose scan failed.
        places: positions of the hand at these scans, each ``(3,)`` [m].
        others: other patches that were found.
    """

    patches: list[Patch]
    places: list[FloatArray]
    others: list[Patch]

    def in_vain(self, patch: Patch) -> bool:
        """Return whether scans of the face of a patch failed at more than one position.

        Args:
            patch: patch to check.
        """
        return sum(patch.is_of(other) for other in self.patches) > 1


def sense_plane(
    robot: Robot,
    guess: FaceGuess,
    *,
    standoff: float,
    rules: Rules,
    label: str = "plane",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire a flat face.

    The scan runs across the line between the two frontal sensors, whose readings are the two rows of it: the paper's
    two directions, each with many points instead of two.

    Args:
        robot: robot with the hand in front of the face, within the range of its beams.
        guess: approximate pose of the face.
        standoff: distance of the hand's front from the face during the scan [m], at least :data:`LEAST_STANDOFF`
            clearances.
        rules: limits of the motions.
        label: label of the readings and the feature.
        errors: error model of the reported poses, for the covariance.

    Raises:
        InputError: The stand-off is too small for the clearance of the rules.
    """
    run = SensingRun(robot, standoff, rules, errors)
    status, finding, feature = acquire_plane(run, guess, label)
    return finish("plane", run, status, finding, feature)


def acquire_plane(run: SensingRun, guess: FaceGuess, label: str, *, beside: Feature | None = None) -> Attempt:
    """Acquire a face within a running acquisition; at the end the hand is over the face, square to it.

    Distant, oblique measurements are improved from above: the hand scans again from over the patch until its estimate
    of the face is stable, and again if the face is not at its expected pose or the space for the hand is not known. If
    the scan of a patch failed at two positions, other patches come first.

    Args:
        run: running acquisition.
        guess: approximate pose of the face.
        label: label of the face.
        beside: sensed face that must not be acquired again; None for none.
    """
    attempt: Attempt = ("nothing", NoFlatFace(), None)
    near = come_near(run, guess)
    if near is not None and not near.reached:
        return failed(near)
    begin = len(run.motions)
    wanted, first, tried = guess, begin, Tried([], [], [])
    for tilt, spacing in SCANS:
        scanned = scan_surroundings(run, tilt, spacing)
        if scanned.status == "timeout":
            return failed(scanned)
        patches = find_patches(cloud_of(run.hand, run.motions[first:]), wanted)
        patches = [p for p in patches if beside is None or not p.is_on(beside)]
        if tried.patches:
            patches = sorted([*patches, *tried.others], key=tried.in_vain)
        if not patches:
            attempt = attempt if scanned.reached or tried.places else failed(scanned)
            continue
        patch, width, ends = _over_one(run, patches, wanted, guess.point, tried.places)
        if patch is None:
            attempt = attempt if tried.places else ends
            continue
        attempt = ends
        tried.others.extend(p for p in patches if not p.is_of(patch))
        # the next scan starts from this pose, and its points replace the earlier ones
        wanted, first = replace(guess, point=patch.point, normal=patch.normal), len(run.motions)
        if not width:
            continue
        reach = HOVER + _BELOW * run.standoff
        down = run.does(approach(run.robot, run.standoff, run.rules, reach=reach))
        attempt = as_guessed(guess, scan(run, label, width)) if down.reached else failed(down)
        if attempt[0] in ("acquired", "timeout"):
            return attempt
        tried.places.append(run.places[-1])
        tried.patches.append(patch)
        wanted, first = guess, begin
        back = back_off(run, HOVER)
        if not back.reached:
            return attempt
    return attempt


def as_guessed(guess: FaceGuess, attempt: Attempt) -> Attempt:
    """Return an acquired face, or a failure if it deviates too much from the guess.

    Args:
        guess: approximate pose of the face.
        attempt: result of the acquisition.
    """
    face = attempt[2]
    if face is None:
        return attempt
    T, own = face.T_world_feature, np.sqrt(np.diag(face.P))
    gap = guess.point - T[:3, 3]
    off, turned = abs(float(gap @ T[:3, 2])), float(np.arccos(np.clip(T[:3, 2] @ guess.normal, -1, 1)))
    turn_sd = float(np.hypot(guess.turn_sd, own[1:].max()))
    sd = float(np.linalg.norm([guess.sd, own[0], turn_sd * np.linalg.norm(gap - (gap @ T[:3, 2]) * T[:3, 2])]))
    if off <= _OTHER * sd and turned <= _OTHER * turn_sd:
        return attempt
    return "unclear", OtherFace(off, turned, sd, turn_sd), None


def _over_one(
    run: SensingRun, patches: list[Patch], wanted: FaceGuess, place: FloatArray, avoid: list[FloatArray]
) -> tuple[Patch | None, float, Attempt]:
    """Move the hand over the first patch with enough clearance.

    Returns:
        The patch; the half width of the scan for which the hand may descend, 0 for another scan from above; the result
        if the acquisition ends here.
    """
    why = list[Motion]()
    for patch in patches:
        if patch.turned(wanted.normal) > _ASTRAY:
            above, _ = hover(run, patch, place, avoid, closely=False)
            if above.reached:
                return patch, 0.0, _UNSURE
        else:
            close, width = hover(run, patch, place, avoid, closely=True)
            if close.reached:
                return patch, width, _UNSURE
            above, _ = hover(run, patch, place, avoid, closely=False)
            if above.reached:
                return patch, 0.0, failed(close)
        why.append(above)
    return None, 0.0, failed(why[0])


def hover(
    run: SensingRun, patch: Patch, wanted: FloatArray, avoid: list[FloatArray], *, closely: bool
) -> tuple[Motion, float]:
    """Move the hand over a patch, where the sensed points leave clearance there and below at the stand-off.

    Args:
        run: running acquisition.
        patch: patch to scan.
        wanted: preferred position ``(3,)`` [m].
        avoid: positions to avoid, each ``(3,)`` [m].
        closely: whether the descent follows, so that the space of the fingers must be known to be free.

    Returns:
        The last motion, and the half width of the scan that has clearance [m].
    """
    hand, cloud = run.hand, run.seen()
    raised, other = over(cloud, patch.point, patch.normal), beside(cloud, patch.point, patch.normal)
    now = run.robot.sensed.T_world_hand
    why: Finding = _NARROW
    reach = float(error_model(hand.rig).max_range[list(hand.frontal)].min())
    height = HOVER if closely else max(HOVER, min(_HIGHER, _IN_REACH * reach - run.standoff))
    places = [(place, along) for width, place, along in stands(patch, hand.baseline, wanted) if width >= _WIDE]
    for width in WIDTHS:
        for place, along in places:
            if any(np.linalg.norm(place - tried) < _ELSEWHERE for tried in avoid):
                continue
            down = facing(hand, place, patch.normal, along, run.standoff, now)
            up = moved(down, height * patch.normal)
            scanned = np.array([[0, 0], [width, 0], [-width, 0], [0, ALONG], [0, -ALONG]])
            low = moved(down, scanned @ [np.cross(patch.normal, along), along])
            if not (fits(run, raised, low) and fits(run, other, path(now, up, hand.front, 24))):
                why = _UNSEEN if why == _UNSEEN else _NO_CLEARANCE
            elif closely and not known(run, np.concatenate([low, path(down, up, hand.front, 8)])):
                why = _UNSEEN
            else:
                run.places.append(place)
                return run.does(go_to(run.robot, up, run.rules)), width
        if why == _UNSEEN:  # rather look again than scan less
            break
    return Motion("hover", "nothing" if why == _NARROW else "limit", why, ()), 0.0
