"""``tanteo sense plane|edge|vertex --image``: where the hand goes follows from what a camera sees of a known part."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tanteo.cli.image_start import ImageOptions, image_options, seen_in, view_of
from tanteo.cli.options import MisuseError
from tanteo.cli.printing import emit, printable
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.acquisition import Predicted
    from tanteo.features import Feature
    from tanteo.io import SceneFile


@dataclass(frozen=True, slots=True)
class GuessOptions:
    """Options of an idea that an image gives.

    Attributes:
        parts: CAD files or folders.
        image: Of the image.
        face: Name of the face to go to, or from which to sense an edge or a corner; None for the best.
        units: Of part files that carry none.
    """

    parts: tuple[str, ...]
    image: ImageOptions
    face: str | None
    units: str | None


def guess_options(
    parts: Sequence[str] | None,
    image: str | None,
    camera: str | None,
    marks: str | None,
    face: str | None,
    units: str | None,
) -> GuessOptions | None:
    """The options from what was typed; None without an image.

    Raises:
        MisuseError: an image without parts, or parts without an image.
    """
    seen = image_options(image, camera, marks)
    if seen is None:
        if parts or face is not None or units is not None:
            raise MisuseError("--parts, --face, --units: expected with --image, got none. Add --image render.")
        return None
    if not parts:
        raise MisuseError("--image: expected with --parts, the CAD files that it may show, got none. Add --parts.")
    return GuessOptions(tuple(parts), seen, face, units)


def guess_from_image(kind: str, scene: SceneFile, options: GuessOptions) -> Predicted:
    """The feature that the likeliest part has for the hand; where it is said to be is told on standard error.

    Raises:
        InputError: nothing was seen, or the part has no such feature that the hand can come to.
    """
    from tanteo.acquisition import predicted
    from tanteo.cli.options import read_unit
    from tanteo.cli.part_files import read_all_parts

    unit = None if options.units is None else read_unit(options.units)
    view = view_of(scene, options.image)
    parts = read_all_parts(list(options.parts), unit, quiet=True)
    seen = seen_in(view, parts)
    if seen is None or not seen.answer.hypotheses:
        raise InputError("--image: expected a part on the table, got none that is known. Add its CAD file to --parts.")
    best, unknown = seen.answer.hypotheses[0], seen.answer.unknown_probability
    if unknown > best.probability:
        raise InputError(
            f"--image: expected one of the parts of --parts, got an unknown object with {100 * unknown:.0f} %. "
            "Add the CAD file of what lies there."
        )
    part = next(part for part in parts if part.name == best.part)
    found = predicted(kind, part, best.T_world_part, best.covariance, -scene.T_world_hand[:3, 2])
    chosen = [p for p in found if options.face in (None, p.faces[0])]
    if not chosen:
        names = ", ".join(dict.fromkeys(p.faces[0] for p in found)) or "none"
        asked = f"face '{options.face}'" if options.face is not None else f"a {kind}"
        raise InputError(
            f"{part.name}: expected {asked} that faces the hand, got faces: {names}. Name one of these with --face, "
            "or let the hand start from another side."
        )
    name = chosen[0].name
    emit(
        [printable(f"The hand goes to {name} of {part.name}, P = {best.probability:.2f}, {_known(chosen[0])}.")],
        sys.stderr,
    )
    return chosen[0]


def _known(expected: Predicted) -> str:
    import numpy as np

    return f"placed by the image to {1e3 * expected.guess.sd:.2g} mm and {np.degrees(expected.guess.turn_sd):.2g} deg"


def compared(expected: Predicted, got: Feature) -> str:
    """How far the sensed feature is from where the image said."""
    import numpy as np

    from tanteo.acquisition import EdgeGuess, FaceGuess
    from tanteo.lie import SO3

    T, guess = got.T_world_feature, expected.guess
    gap = guess.point - T[:3, 3]
    if isinstance(guess, FaceGuess):
        off, own, said = f"{1e3 * abs(gap @ T[:3, 2]):.2g}", T[:3, 2], guess.normal
    elif isinstance(guess, EdgeGuess):
        own = T[:3, 0] * np.sign(T[:3, 0] @ guess.direction)
        off, said = f"{1e3 * np.linalg.norm(SO3.cross(gap, own)):.2g}", guess.direction
    else:
        return f"{1e3 * np.linalg.norm(gap):.2g} mm off what was expected, {_known(expected)}"
    turned = f"{np.degrees(np.arctan2(np.linalg.norm(SO3.cross(own, said)), own @ said)):.2g}"
    return f"{off} mm and {turned} deg off what was expected, {_known(expected)}"
