"""Implement ``tanteo calibrate hand-eye``: where a camera is on the hand, or beside the robot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.printing import complain, emit, leave, put_json
from tanteo.replaced import replaced

if TYPE_CHECKING:
    from tanteo.sensors.calibration import HandEye

_Samples = Annotated[
    str, typer.Argument(metavar="SAMPLES", help="Table, YAML or JSON of poses of the hand and of the target.")
]
_Fixed = Annotated[
    bool, args.option("--fixed-camera", None, "The camera is fixed beside the robot, and the target is on the hand.")
]
_Write = Annotated[
    str | None, args.option("--write", "FILE.yaml", "File for the result, in the format of easy_handeye2.")
]


def hand_eye(samples: _Samples, fixed_camera: _Fixed = False, write: _Write = None, json: args.Json = False) -> None:
    """Calibrate a camera on the hand from poses of the hand and of a target.

    The pose of the camera has a covariance; samples that contradict the others, motions that leave a direction free and
    the next pose are named. The noise need not be known.
    """
    from tanteo.io.poses.hand_eye_file import hand_eye_yaml, read_hand_eye_samples
    from tanteo.sensors.calibration import calibrate_hand_eye

    files.check_target("--write", write)
    files.check_different(("--write", write), inputs=[("the samples", samples)])
    hands, targets = read_hand_eye_samples(samples)
    found = calibrate_hand_eye(hands, targets, mounted="world" if fixed_camera else "hand")
    done = found.status == "calibrated"
    if write is not None and done:
        text = hand_eye_yaml(
            found.T_mount_camera,
            found.covariance,
            on_hand=not fixed_camera,
            hand="tool0",
            camera="camera",
            base="base",
            target="target",
        )
        with files.writing("--write", write), replaced(write) as file:
            file.write_text(text, encoding="utf-8")
    if json:
        put_json(_document(found))
    else:
        emit(_lines(found, len(hands)))
    if write is not None and not done:
        complain("warning", f"{write} was not written: the samples do not determine the camera's pose.")
    leave(decided=done)


def _lines(found: HandEye, count: int) -> list[str]:
    frame = "hand" if found.mounted == "hand" else "base of the robot"
    T, sds = found.T_mount_camera, found.covariance.diagonal() ** 0.5
    x, y, z = 1e3 * T[:3, 3]
    roll, pitch, yaw = _angles(T)
    across, along, turn = found.sds
    return [
        f"{found.status}: camera in the {frame} at x {x:.3f} y {y:.3f} z {z:.3f} mm, "
        f"roll {roll:.3f} pitch {pitch:.3f} yaw {yaw:.3f} deg",
        "  sd        x {:.3g}  y {:.3g}  z {:.3g} mm, ".format(*1e3 * sds[:3])
        + "rx {:.3g}  ry {:.3g}  rz {:.3g} deg, camera frame".format(*map(math.degrees, sds[3:])),
        f"  samples   {int(found.used.sum())} of {count}; sd of one observation of the target: {1e3 * across:.3g} mm "
        f"across and {1e3 * along:.3g} mm along the optical axis, {math.degrees(turn):.3g} deg",
        "",
        found.message,
    ]


def _angles(T: Any) -> tuple[float, float, float]:
    from tanteo.geometry.location import matrix_to_loc

    roll, pitch, yaw = map(math.degrees, matrix_to_loc(T)[3:])
    return roll, pitch, yaw


def _pose(T: Any, frame: Literal["hand", "base"]) -> dict[str, Any]:
    from tanteo.geometry import SO3

    return {
        "frame": frame,
        "position_m": T[:3, 3].tolist(),
        "quaternion_wxyz": SO3.as_quaternion(T[:3, :3]).tolist(),
        "matrix": T.tolist(),
    }


def _document(found: HandEye) -> dict[str, Any]:
    """Return the result as a JSON document in SI units."""
    frame: Literal["hand", "base"] = "hand" if found.mounted == "hand" else "base"
    other: Literal["hand", "base"] = "base" if found.mounted == "hand" else "hand"
    covariance = {"order": "x y z rx ry rz", "perturbation": "right", "units": "m rad"}
    return {
        "schema": "tanteo.hand_eye/1",
        "status": found.status,
        "message": found.message,
        "camera": {
            "pose": _pose(found.T_mount_camera, frame),
            "covariance": {**covariance, "frame": "camera", "matrix": found.covariance.tolist()},
        },
        "target": {
            "pose": _pose(found.T_other_target, other),
            "covariance": {**covariance, "frame": "target", "matrix": found.covariance_target.tolist()},
        },
        "observation_sds": {"across_m": found.sds[0], "along_m": found.sds[1], "rotation_rad": found.sds[2]},
        "excluded": [k + 1 for k, used in enumerate(found.used.tolist()) if not used],
        "deviations_m_rad": found.deviations.tolist(),
        "unobserved": list(found.unobserved),
        "next": {"pose": _pose(found.T_next, "base"), "motion": found.next_motion},
    }
