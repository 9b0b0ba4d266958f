"""Implement ``tanteo calibrate hand-eye``: where a camera is on the hand, or beside the robot."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tanteo import io
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.image import INEXACT, hand_poses_of
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain, emit, leave, print_text, put_json
from tanteo.errors import DegenerateError, InputError
from tanteo.replaced import replaced

if TYPE_CHECKING:
    from tanteo.geometry.typing import Transforms
    from tanteo.sensors.calibration import HandEye

_Samples = Annotated[
    list[str],
    typer.Argument(
        metavar="SAMPLES|IMAGE...",
        help="Table, YAML or JSON of poses of the hand and of the target, or images of a board (--board).",
    ),
]
_Board = Annotated[
    str | None,
    args.option(
        "--board",
        "BOARD",
        "Board in the images: charuco:7x5,30mm,22mm,DICT_5X5_100 (squares, side of a square, of a marker), "
        "grid:6x6,24mm,7.2mm,DICT_APRILTAG_36h11 (markers, side, gap), or marker:12,50mm,DICT_APRILTAG_36h11.",
    ),
]
_CameraFile = Annotated[
    str | None, args.option("--camera", "FILE", "Calibration file of the camera of the images (OpenCV, ROS, Kalibr).")
]
_HandPoses = Annotated[
    str | None,
    args.option("--hand-poses", "FILE", "Poses of the hand at which the images were taken, one row each (CSV)."),
]
_Fixed = Annotated[
    bool, args.option("--fixed-camera", None, "The camera is fixed beside the robot, and the target is on the hand.")
]
_Write = Annotated[
    str | None, args.option("--write", "FILE.yaml", "File for the result, in the format of easy_handeye2.")
]


def hand_eye(
    samples: _Samples,
    board: _Board = None,
    camera: _CameraFile = None,
    hand_poses: _HandPoses = None,
    fixed_camera: _Fixed = False,
    write: _Write = None,
    json: args.Json = False,
) -> None:
    """Calibrate a camera on the hand from poses of the hand and of a target, or images of a board.

    The pose of the camera has a covariance; samples that contradict the others, motions that leave a direction free and
    the next pose are named. The noise need not be known.
    """
    from tanteo.io.poses.hand_eye_file import hand_eye_yaml
    from tanteo.sensors.calibration import calibrate_hand_eye

    files.check_target("--write", write)
    inputs = [("the samples", one) for one in samples] + [("--camera", camera), ("--hand-poses", hand_poses)]
    files.check_different(("--write", write), inputs=inputs)
    hands, targets, names = _read(samples, board, camera, hand_poses)
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
        emit(_lines(found, names))
    if write is not None and not done:
        complain("warning", f"{write} was not written: the samples do not determine the camera's pose.")
    leave(decided=done)


def _read(
    samples: list[str], board: str | None, camera: str | None, hand_poses: str | None
) -> tuple[Transforms, Transforms, list[str]]:
    """Return poses of the hand and of the target, and the images of the samples, empty for samples of a file."""
    if (board is None) != (camera is None) or (board is None) != (hand_poses is None):
        raise MisuseError(
            "--board, --camera, --hand-poses: expected all three beside images of a board, or none beside a file of "
            "samples, got some. Add the others."
        )
    if board is None or camera is None or hand_poses is None:
        if len(samples) > 1:
            raise MisuseError(
                f"SAMPLES: expected one file of samples, or images of a board with --board, got {len(samples)} files. "
                "Add --board, --camera and --hand-poses."
            )
        from tanteo.io.poses.hand_eye_file import read_hand_eye_samples

        return *read_hand_eye_samples(samples[0]), []
    return _of_images(samples, board, camera, hand_poses)


def _of_images(images: list[str], board: str, camera: str, hand_poses: str) -> tuple[Transforms, Transforms, list[str]]:
    """Return poses of the hand and of the board in the images that show it, and their names.

    Raises:
        MisuseError: the rows of the poses of the hand are not those of the images.
        InputError: a file cannot be read, or no image shows the board.
    """
    import numpy as np

    from tanteo.io.poses.board_text import parse_board
    from tanteo.vision.boards import find_board

    stated, poses = parse_board(board), hand_poses_of(images, hand_poses)
    hands, targets, names = [], [], []
    for image, pose in zip(images, poses, strict=True):
        pixels = io.read_image(image)
        taken = io.read_camera(camera, shape=pixels.shape)
        if image == images[0]:
            for note in taken.notes:
                complain("warning", f"{camera}: {note}")
        try:
            seen = find_board(pixels, taken, stated)
        except DegenerateError as error:
            complain("warning", f"{image} is excluded: {error}")
            continue
        print_text(f"{image}: {seen.corners} corners of the board, {seen.rms:.2f} px rms.", sys.stderr)
        if seen.rms > INEXACT:
            complain("warning", f"{image}: the corners contradict the board or the camera file. Check sizes and lens.")
        hands.append(pose.T_base_hand)
        targets.append(seen.T_camera_board)
        names.append(image)
    if not names:
        raise InputError(f"--board: expected {board} in the images, got none that shows it. Check its text.")
    return np.stack(hands), np.stack(targets), names


def _lines(found: HandEye, names: list[str]) -> list[str]:
    frame = "hand" if found.mounted == "hand" else "base of the robot"
    T, sds = found.T_mount_camera, found.covariance.diagonal() ** 0.5
    x, y, z = 1e3 * T[:3, 3]
    roll, pitch, yaw = _angles(T)
    across, along, turn = found.sds
    return [
        f"{found.status}: camera in the {frame} at x {x:.3f} y {y:.3f} z {z:.3f} mm, "
        f"roll {roll:z.3f} pitch {pitch:z.3f} yaw {yaw:z.3f} deg",
        "  sd        x {:.3g}  y {:.3g}  z {:.3g} mm, ".format(*1e3 * sds[:3])
        + "rx {:.3g}  ry {:.3g}  rz {:.3g} deg, camera frame".format(*map(math.degrees, sds[3:])),
        f"  samples   {int(found.used.sum())} of {len(found.used)}; sd of one observation of the target: "
        f"{1e3 * across:.3g} mm across and {1e3 * along:.3g} mm along the optical axis, {math.degrees(turn):.3g} deg",
        *(f"  excluded  {k + 1} is {name}" for k, name in enumerate(names) if not found.used[k]),
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
