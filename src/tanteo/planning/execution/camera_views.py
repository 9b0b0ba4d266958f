"""The next view of a camera on the hand: where it can be, its expected information, and its duration.

Views are on a hemisphere about the possible parts, at a distance from which the image shows them whole. Views that the
hand or its arm cannot reach, that come too near, or that show nothing are excluded, with the reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tanteo.fitting.localization import pose_information
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, Transforms, Vectors
from tanteo.hand import Hand
from tanteo.planning.execution.possible import FreeSpace
from tanteo.planning.samples import useful_covariance
from tanteo.planning.start import Start
from tanteo.planning.state import SensingState
from tanteo.posterior import box_corners
from tanteo.posterior.alternatives import first_applies
from tanteo.vision import Camera, prepare_vision
from tanteo.vision.camera import Mounting
from tanteo.vision.expected import expected_information

_TILTS, _TURNS, _ROLLS = (15.0, 40.0, 60.0), 8, 4
"""Angles of the views from the vertical [deg], and numbers of turns about it and about the optical axis."""

_MODES, _LEAST = 6, 0.005
"""Largest number of hypotheses that are compared, and smallest probability of one."""

_SAME_VIEW = float(np.cos(np.radians(20.0)))
"""Cosine of the angle between the optical axes of views that count as one: less than between neighbours."""

_FILLED = 0.8
"""Share of the image that the possible parts fill."""

_SHUTTER = 0.5
"""Duration of a view without travel [s]."""

OUT_OF_REACH, TOO_NEAR = "out of reach", "too near to a part, the table or furniture"
NOTHING, TAKEN = "without an edge in the image", "taken before"
"""Reasons for which views are excluded."""


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """Camera on the hand.

    Attributes:
        camera: calibrated camera; its pose is not used.
        mounting: its pose on the hand with covariance.
        hand_covariance: covariance of a pose of the hand ``(6, 6)``, hand frame, right [m, rad]; None if it is exact.
    """

    camera: Camera
    mounting: Mounting
    hand_covariance: Covariances | None = None

    def camera_at(self, T_world_hand: Transforms) -> Camera:
        """Return the camera with its pose and its errors where the hand has a pose ``(4, 4)``."""
        return self.mounting.camera_at(self.camera, T_world_hand, self.hand_covariance)


class Eyes(Protocol):
    """Interface of a camera on the hand of a robot."""

    @property
    def eye(self) -> Eye:
        """Return the camera and its place on the hand."""
        ...

    def photograph(self) -> Start:
        """Take an image at the present pose of the hand, and return the start of a session with all images so far."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class NextView:
    """Best view of a camera on the hand.

    Attributes:
        T_world_hand: pose of the hand ``(4, 4)``; of the present one if no view is possible.
        gain: expected information about part and pose [nats].
        seconds: duration with travel [s].
        excluded: number of views that are excluded, by reason.
    """

    T_world_hand: Transforms
    gain: float
    seconds: float
    excluded: Mapping[str, int] = field(default_factory=dict)


def next_view(
    state: SensingState,
    hand: Hand,
    eye: Eye,
    space: FreeSpace,
    here: Transforms,
    speed: float,
    taken: Sequence[Transforms] = (),
    tolerance: float | None = None,
    feature: str | None = None,
) -> NextView:
    """Return the view with the most expected information per second.

    Accuracy beyond the tolerance has no value, as for readings. Hypotheses by which earlier images show another object
    are not compared: another image would show it, too.

    Args:
        state: posterior of the session.
        hand: hand that carries the camera.
        eye: camera on the hand.
        space: free space of the hand.
        here: present pose of the hand ``(4, 4)``.
        speed: speed of the hand [m/s].
        taken: poses of the hand of earlier views; views near them are excluded.
        tolerance: tolerance of the part's corners, or of the feature [m]; None for all accuracy.
        feature: feature to which the tolerance applies; None for the corners.
    """
    shown = np.ones(len(state.weights), dtype=np.bool_)
    if state.posterior is not None:
        shown = first_applies(state.posterior.problem, state.modes)
    modes = np.flatnonzero((state.weights >= _LEAST) & shown)
    modes = modes[np.argsort(-state.weights[modes], kind="stable")][:_MODES]
    if not len(modes):
        return NextView(here, 0.0, _SHUTTER)
    hypotheses = [
        (
            prepare_vision(state.target(k).part),
            state.poses[k],
            useful_covariance(state, k, _at_maximum(state, k), tolerance, feature),
        )
        for k in map(int, modes)
    ]
    corners = np.concatenate([SE3.apply(T, box_corners(model.part)) for model, T, _ in hypotheses])
    excluded, best = Counter[str](), NextView(here, 0.0, _SHUTTER)
    for Ts in _hands(eye, 0.5 * (corners.min(axis=0) + corners.max(axis=0)), corners, here):
        if any(_same_direction(eye, Ts[0], T) for T in taken):
            excluded[TAKEN] += 1
            continue
        clear = Ts[space.allows(Ts)]
        if not len(clear):
            excluded[TOO_NEAR] += 1
            continue
        within = clear[space.reaches(clear)]
        if not len(within):
            excluded[OUT_OF_REACH] += 1
            continue
        gain, share = expected_information(hypotheses, state.weights[modes], eye.camera_at(within[0]))
        gain *= float(state.weights[modes].sum())
        if share <= 0:
            excluded[NOTHING] += 1
            continue
        seconds = _SHUTTER + float(np.linalg.norm(within[0][:3, 3] - here[:3, 3])) / speed
        if gain / seconds > best.gain / best.seconds:
            best = NextView(within[0], gain, seconds)
    return NextView(best.T_world_hand, best.gain, best.seconds, dict(excluded))


def _at_maximum(state: SensingState, k: int) -> Covariances:
    """Return the covariance of a mode's pose about its maximum, if its samples reach farther ``(6, 6)``.

    Those of an image reach as far as the prior pose, because the image may show another object.
    """
    C = state.covariances[k]
    if not state.modes or state.modes[k].normal:
        return C
    return np.asarray(np.linalg.inv(np.linalg.inv(C) + pose_information(state.modes[k].information)))


def _same_direction(eye: Eye, T_world_hand: Transforms, other: Transforms) -> bool:
    """Return whether two poses of the hand see the parts from about the same direction."""
    axes = [(T @ eye.mounting.T_hand_camera)[:3, 2] for T in (T_world_hand, other)]
    return bool(axes[0] @ axes[1] > _SAME_VIEW)


def _hands(eye: Eye, middle: Vectors, corners: Vectors, here: Transforms) -> list[Transforms]:
    """Return poses of the hand for each view ``(rolls, 4, 4)``, the one with the least rotation first."""
    camera = eye.camera
    radius = float(np.linalg.norm(corners - middle, axis=1).max())
    half = 0.5 * _FILLED * float(np.min(np.array(camera.size) / camera.focal))
    away = radius * (1 + 1 / half)
    back = SE3.inverse(eye.mounting.T_hand_camera)
    out = []
    for tilt in np.radians(_TILTS):
        for turn in 2 * np.pi * np.arange(_TURNS) / _TURNS:
            way = np.array([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)])
            R = SO3.frame_from_axis(-way, 2)
            rolls = [R @ SO3.axis_rotation(2, 2 * np.pi * k / _ROLLS) for k in range(_ROLLS)]
            Ts = SE3.from_parts(np.stack(rolls), middle + away * way) @ back
            rotation = np.einsum("ij,nij->n", here[:3, :3], Ts[:, :3, :3])
            out.append(np.asarray(Ts[np.argsort(-rotation, kind="stable")]))
    return out
