"""A face: look, choose a patch, stand over it, come down and scan it."""

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
from tanteo.hand.acquisition.ways import come_near, facing, fits, known, look_around, moved
from tanteo.hand.motion.following import approach
from tanteo.hand.motion.steering import Motion, Rules
from tanteo.hand.motion.travelling import go_to, path
from tanteo.hand.robot import Robot
from tanteo.sensors import RobotPreset, error_model
from tanteo.words.findings import FaceNotRepeated, FacesTooNarrow, Finding, NoFlatFace, NoRoom, NotAllSeen, OtherFace

HOVER = 0.06
"""The hand stands so much higher than the stand-off before it comes down [m]."""

_HIGHER, _IN_REACH = 0.075, 0.8
"""It looks from this much higher, where it does not know yet what is beside it: what its fingers swing through there,
it sees from there farther down; but no farther from the face than this share of the frontal sensors' range [m]."""

_BELOW = 0.3
"""It comes down so many stand-offs farther than to where it should meet the face: what is below was not seen."""

LOOKS = ((0.25, 0.09), *(((0.22, 0.05),) * 9))
"""Of each look around: tilt of the hand's axis at its end, and from turn to turn of the spiral [rad]."""


_ELSEWHERE = 0.008
"""Another place to stand is this far from those that failed [m]."""

_NARROW = FacesTooNarrow()
_NO_ROOM = NoRoom("over the face")
_UNSEEN = NotAllSeen("over the face")
_UNSURE: Attempt = ("unclear", FaceNotRepeated(), None)


_ASTRAY = np.radians(12.0)
"""A face whose normal is this far from what it should be is looked at once more from above [rad]."""

_WIDE = 0.004
"""Least room around both sensors on a patch [m]."""


_OTHER = 5.0
"""A face that is more standard deviations off the idea is another one."""


@dataclass(frozen=True, slots=True)
class Tried:
    """Patches that could not be scanned, where the hand stood ``(3,)`` [m], and other patches that were seen."""

    patches: list[Patch]
    places: list[FloatArray]
    others: list[Patch]

    def in_vain(self, patch: Patch) -> bool:
        """Whether the face of a patch could not be scanned, at more places than one."""
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
        guess: About where the face is.
        standoff: Of the hand's front during the scan [m]; :data:`LEAST_STANDOFF` clearances or more.
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
    """The same within a run, for another face than ``beside``; the hand is left over the face, square to it.

    What was seen obliquely from afar is seen better from above: the hand looks again from over the patch, until its
    idea of the face stays the same, and again if the face then is not where it should be, or not all was seen where the
    hand is to go. Where a patch could not be scanned at two places, the others that were seen come first.
    """
    attempt: Attempt = ("nothing", NoFlatFace(), None)
    near = come_near(run, guess)
    if near is not None and not near.reached:
        return failed(near)
    begin = len(run.motions)
    wanted, first, tried = guess, begin, Tried([], [], [])
    for tilt, spacing in LOOKS:
        looked = look_around(run, tilt, spacing)
        if looked.status == "timeout":
            return failed(looked)
        patches = find_patches(cloud_of(run.hand, run.motions[first:]), wanted)
        patches = [p for p in patches if beside is None or not p.is_on(beside)]
        if tried.patches:
            patches = sorted([*patches, *tried.others], key=tried.in_vain)
        if not patches:
            attempt = attempt if looked.reached or tried.places else failed(looked)
            continue
        patch, width, ends = _over_one(run, patches, wanted, guess.point, tried.places)
        if patch is None:
            attempt = attempt if tried.places else ends
            continue
        attempt = ends
        tried.others.extend(p for p in patches if not p.is_of(patch))
        # the next look is from here: what it shows replaces what was seen before
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
    """A face that was sensed, unless the idea was known too well for it to be the one that was meant."""
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
    """The hand over the first patch that has room for it.

    Returns:
        The patch; the half width of the scan for which the hand may come down, 0 if it should look once more; what is
        to be said if it all ends here.
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
    """Bring the hand over a patch, where what was seen leaves room for it there and below at the stand-off.

    It stands rather near the wanted place, off those to avoid; closely, as it comes down next: only where all was seen
    free that the fingers will take.

    Returns:
        How it ended, and the half width of the scan for which there is room [m].
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
                why = _UNSEEN if why == _UNSEEN else _NO_ROOM
            elif closely and not known(run, np.concatenate([low, path(down, up, hand.front, 8)])):
                why = _UNSEEN
            else:
                run.places.append(place)
                return run.does(go_to(run.robot, up, run.rules)), width
        if why == _UNSEEN:  # rather look again than scan less
            break
    return Motion("hover", "nothing" if why == _NARROW else "limit", why, ()), 0.0
