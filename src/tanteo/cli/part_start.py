"""From where ``tanteo sense part`` and ``tanteo view`` start: what an image or a prior pose says of the parts."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NoReturn

import typer

from tanteo.cli.options import MisuseError
from tanteo.cli.printing import emit, put
from tanteo.cli.running import UNDECIDED
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Start
    from tanteo.answers import PosePrior
    from tanteo.cli.image_start import View
    from tanteo.cli.sensing_part import PartOptions
    from tanteo.io import SceneFile
    from tanteo.parts import Part


def start_of(
    scene: SceneFile,
    parts: Sequence[Part],
    known: PosePrior | None,
    view: View | None,
    options: PartOptions,
) -> Start | None:
    """What an image leaves open, or what is roughly known; the latter also where the image is wrong, None without.

    Args:
        scene: Says the prior pose, unless an option does.
        parts: Any of them may be there.
        known: A prior pose of their frames.
        view: What the camera sees.
        options: Say what else is assumed beforehand.
    """
    start = _seen_or_rough(scene, parts, known, view)
    if start is None:
        return None
    outlier_rate, unknown = (
        options.outlier_rate or start.priors.outlier_rate,
        options.unknown_prior or start.priors.unknown,
    )
    return replace(start, priors=replace(start.priors, outlier_rate=outlier_rate, unknown=unknown))


def _seen_or_rough(scene: SceneFile, parts: Sequence[Part], known: PosePrior | None, view: View | None) -> Start | None:
    from tanteo.cli.image_start import start_from_view
    from tanteo.inference import prepare

    if view is not None and known is None and scene.prior is None:
        return start_from_view(view, tuple(prepare(part) for part in parts), None)
    rough = _rough_start(scene, parts, known)
    return rough if view is None else start_from_view(view, rough.targets, rough)


def _rough_start(scene: SceneFile, parts: Sequence[Part], known: PosePrior | None) -> Start:
    """Where each part may be: what the options say of its frame, or what the scene says of its middle."""
    import numpy as np

    from tanteo.active import Start, around
    from tanteo.answers import Priors
    from tanteo.inference import prepare

    if known is not None and (known.T_world_part is None or known.table is not None or known.box is not None):
        raise MisuseError(
            "--pose-prior, --prior: expected a prior pose and nothing else, got a table or a box. Say --pose-prior."
        )
    targets = tuple(prepare(part) for part in parts)
    if known is not None and known.T_world_part is not None and known.covariance is not None:
        n = len(targets)
        Ts, covariances = (np.repeat(a[None], n, axis=0) for a in (known.T_world_part, known.covariance))
        return Start(targets, np.arange(n), Ts, covariances, np.ones(n), Priors())
    if scene.prior is None:
        raise InputError(
            f"{scene.source}: expected a table [prior] with the prior pose, got none. Add it, give --pose-prior, "
            "or show an --image."
        )
    return around(targets, scene.prior.T, scene.prior.C)


def nothing_seen(*, as_json: bool) -> NoReturn:
    """The answer where no hand is sent."""
    from tanteo.answers import Answer
    from tanteo.io import recognition_json

    message = "the image shows no part on the table, and no prior pose is given. Give --pose-prior."
    if as_json:
        put(recognition_json(Answer("unknown", message, (), 1.0)))
    emit([f"unknown: {message}"], sys.stderr if as_json else sys.stdout)
    raise typer.Exit(UNDECIDED)
