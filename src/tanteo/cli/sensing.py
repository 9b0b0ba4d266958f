"""``tanteo sense``: one acquisition in the simulator, told in words."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import typer

from tanteo.cli.options import misuse
from tanteo.cli.printing import bold, emit, printable, put
from tanteo.cli.targets import check_different, check_target, parts_read, writing
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.acquisition import Acquired, Predicted
    from tanteo.cli.image_guess import GuessOptions
    from tanteo.features import Feature
    from tanteo.hand import ForbiddenBox
    from tanteo.io import SceneFile
    from tanteo.simulator import SimulatedHand

_UNDECIDED = 3


def sense(
    kind: str,
    scene_path: str,
    *,
    standoff: str | None,
    seed: int | None,
    record: str | None,
    forbid: Sequence[str],
    image: GuessOptions | None,
    as_json: bool,
    verbose: bool,
) -> None:
    """Acquire one feature of a scene file, print it; exits with 3 when it is not acquired."""
    from tanteo.cli.image_guess import guess_from_image
    from tanteo.io import read_scene, sensed_json, write_readings
    from tanteo.simulator import clearances

    with misuse():
        distance = read_standoff(standoff)
        if seed is not None and seed < 0:
            raise InputError(f"--seed: expected 0 or more, got {seed}. Use 0.")
        boxes = [_forbidden(text) for text in forbid]
    check_target("--record", record)
    seen = [] if image is None else [*image.image.files, *parts_read(image.parts)]
    check_different(("--record", record), inputs=[("--scene", scene_path), *seen])
    scene = read_scene(scene_path)
    if seed is not None:
        scene = replace(scene, seed=seed)
    if distance is not None:
        scene = replace(scene, standoff=distance, clearance=scene.clearance * distance / scene.standoff)
    if boxes:
        scene = replace(scene, workspace=replace(scene.workspace, forbidden=(*scene.workspace.forbidden, *boxes)))
    expected = None if image is None else guess_from_image(kind, scene, image)
    if expected is not None:
        scene = replace(scene, guesses={**scene.guesses, kind: expected.guess})
    got, robot = run(kind, scene)
    least = float(clearances(scene.scene, scene.hand.body, np.array(robot.truth)).min())
    if record is not None:
        if got.readings is None:
            emit(["warning: nothing was read on purpose, so there is no record."], sys.stderr)
        else:
            with writing("--record", record):
                write_readings(got.readings, record, unit="m")
    if as_json:
        put(sensed_json(got, seed=scene.seed, clearance=least, expected=expected))
    else:
        emit(sensed_lines(got, scene, least, record, expected, verbose=verbose))
    if not got.acquired:
        raise typer.Exit(_UNDECIDED)


def run(kind: str, scene: SceneFile) -> tuple[Acquired, SimulatedHand]:
    """The acquisition, and the robot that did it.

    Raises:
        InputError: The file has no idea of such a feature.
    """
    from tanteo.acquisition import EdgeGuess, FaceGuess, VertexGuess, sense_edge, sense_plane, sense_vertex
    from tanteo.motion import Rules
    from tanteo.simulator import SimulatedHand

    guess = scene.guesses.get(kind)
    robot = SimulatedHand(
        scene.scene, scene.hand, scene.T_world_hand, rng=np.random.default_rng(scene.seed), cell=scene.cell
    )
    rules = Rules(clearance=scene.clearance, workspace=scene.workspace)
    errors = scene.cell.robot
    if isinstance(guess, FaceGuess):
        return sense_plane(robot, guess, standoff=scene.standoff, rules=rules, errors=errors), robot
    if isinstance(guess, EdgeGuess):
        return sense_edge(robot, guess, standoff=scene.standoff, rules=rules, errors=errors), robot
    if isinstance(guess, VertexGuess):
        return sense_vertex(robot, guess, standoff=scene.standoff, rules=rules, errors=errors), robot
    raise InputError(f"{scene.source}: expected a table [sense.{kind}] with a rough idea of it, got none. Add it.")


def sensed_lines(
    got: Acquired,
    scene: SceneFile,
    least: float,
    record: str | None,
    expected: Predicted | None = None,
    *,
    verbose: bool = False,
) -> list[str]:
    """The lines for a person."""
    from tanteo.cli.image_guess import compared

    lines = [
        bold(
            printable(
                f"{got.status}: {got.kind} {_where(got.feature)}" if got.feature else f"{got.status}: no {got.kind}"
            )
        )
    ]
    if got.feature is not None:
        lines += _spread(got.feature)
        lines += [f"  image       {compared(expected, got.feature)}"] if expected is not None else []
    lines += [f"  also        {f.kind.name} '{printable(f.label)}' {_where(f)}" for f in got.others]
    if got.readings is not None:
        used = ", ".join(dict.fromkeys(got.readings.sensors))
        lines.append(
            f"  readings    {len(got.readings)} ranges of {used}" + (f", written to {record}" if record else "")
        )
    lines.append(f"  time        {got.seconds:.1f} s simulated, {len(got.motions)} motions, seed {scene.seed}")
    lines.append(
        f"  clearance   {1e3 * least:.1f} mm at least, of the whole hand from everything; the stand-off was "
        f"{1e3 * scene.standoff:.3g} mm"
    )
    if verbose:
        lines += [f"    {m.seconds:6.2f} s  {m.name:10}  {m.status:8}  {printable(m.message)}" for m in got.motions]
    return [*lines, "", printable(_sentence(got))]


def _sentence(got: Acquired) -> str:
    message = got.message[:1].upper() + got.message[1:]
    advice = {
        "acquired": "",
        "nothing": " Give a better idea of where it is, or start nearer to it.",
        "lost": " Start more squarely before the face, or choose one that is wider.",
        "limit": " Give the hand more room, a smaller stand-off, or a start from another side.",
        "timeout": " Start nearer.",
        "unclear": " Sense it from another place, or sense the faces beside it.",
    }[got.status]
    return f"{message}.{advice}"


def _where(feature: Feature | None) -> str:
    if feature is None:
        return ""
    T = feature.T_world_feature
    place = "at x {:.2f} y {:.2f} z {:.2f} mm".format(*(1e3 * T[:3, 3]))
    axis = feature.kind.axis
    if axis is None:
        return place + " in the world"
    name = "along" if axis == 0 else "outward normal"
    return place + ", {} ({:.4f}, {:.4f}, {:.4f}) in the world".format(name, *T[:3, axis])


def _spread(feature: Feature) -> list[str]:
    """One standard deviation, all errors and without those that the readings share."""
    from tanteo.features import feature_covariance

    rows = list(feature.kind.rows)
    whole = np.sqrt(np.diag(feature_covariance(feature))[rows])
    own = np.sqrt(np.diag(feature.P))
    names = {0: "along x", 1: "along y", 2: "along z", 3: "about x", 4: "about y", 5: "about z"}
    if feature.kind.shape == "plane":
        names[2] = "along the normal"

    def words(sds: np.ndarray) -> str:
        return ", ".join(
            f"{1e3 * s:.3g} mm {names[r]}" if r < 3 else f"{np.degrees(s):.3g} deg {names[r]}"
            for s, r in zip(sds, rows, strict=True)
        )

    return [
        f"  sd          {words(whole)}, in the feature's own frame ({feature.kind.frame})",
        f"  of readings {words(own)}, with the errors known that all readings of a sensor share",
    ]


def read_standoff(text: str | None) -> float | None:
    """The length of ``--standoff`` [m]; None for the scene's.

    Raises:
        InputError: Not a length that a hand can keep.
    """
    from tanteo.io import parse_length

    if text is None:
        return None
    value = parse_length(text, "--standoff")
    if not 1e-3 <= value <= 1:
        raise InputError(f"--standoff: expected a length of 1 mm to 1 m, got '{text}'. Write it as 20mm.")
    return value


def _forbidden(text: str) -> ForbiddenBox:
    from tanteo.hand import ForbiddenBox
    from tanteo.io import parse_lengths

    values = parse_lengths(text, "--forbid")
    if len(values) != 6:
        raise InputError(
            f"--forbid: expected two corners of three lengths, got '{text}'. Write it as 150,0,0,180,60,250mm."
        )
    return ForbiddenBox(text, np.array(values[:3]), np.array(values[3:]))
