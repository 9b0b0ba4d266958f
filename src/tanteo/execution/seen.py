"""What an image leaves open, as the start of a session: the hand then senses what the camera could not tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.active import Start, from_hypotheses
from tanteo.answers import Priors
from tanteo.errors import InputError
from tanteo.inference import PreparedPart
from tanteo.lie import SE3
from tanteo.parts import Part
from tanteo.vision import Sight, Sighting

HYPOTHESES = 20
"""Answers of an image that are worth asking for: the true one is often not among the first five."""

_LEAST, _HALF = 0.02, 0.5
"""Probability that the image is wrong, at least and at most, whatever it says."""

_FORGOTTEN = 1e-4
"""Answers of the image less probable than this are left out."""


def part_seen(sight: Sight, prior: Start | None = None) -> Sighting | None:
    """The object that is meant: the one nearest to where the part roughly is, else the largest; None without any.

    Args:
        sight: of an image, known furniture left out (``see_table(..., ignore=)``).
        prior: where the part is expected.
    """
    some = [seen for seen in sight.objects if seen.answer.hypotheses]
    if not some or prior is None:
        return some[0] if some else None
    centres = [SE3.apply(T, prior.targets[k].part.centroid) for k, T in zip(prior.part, prior.Ts, strict=True)]
    place = np.average(centres, axis=0, weights=prior.weights)[:2]

    def away(seen: Sighting) -> float:
        mode, best = seen.modes[0], seen.answer.hypotheses[0]
        return float(np.linalg.norm(SE3.apply(best.T_world_part, mode.model.part.centroid)[:2] - place))

    return min(some, key=away)


def seen_start(
    seen: Sighting | None, targets: Sequence[PreparedPart] | Sequence[Part], prior: Start | None = None
) -> Start:
    """The start of a session from what an image shows.

    The image's answers are prior poses with its probabilities. Where it is wrong, which is as probable as all else than
    its answers and 2 % at least, the prior pose holds; without one, the session may find that it is an unknown object.

    Args:
        seen: the object; None if nothing was seen.
        targets: all parts that it may be.
        prior: where each part may be without the image, of the same targets.

    Raises:
        InputError: nothing was seen, and there is no prior pose either.
    """
    answers = [] if seen is None else [h for h in seen.answer.hypotheses if h.probability > _FORGOTTEN]
    if not answers:
        if prior is None:
            raise InputError(
                "image: expected a part on the table, got none that is known. Give a prior pose, or its CAD file."
            )
        return prior
    assert seen is not None
    wrong = float(np.clip(1 - sum(h.probability for h in seen.answer.hypotheses), _LEAST, _HALF))
    image = from_hypotheses(answers, targets, Priors(unknown=wrong))
    if prior is None:
        return image
    return Start(
        image.targets,
        np.concatenate([image.part, prior.part]),
        np.concatenate([image.Ts, prior.Ts]),
        np.concatenate([image.covariances, prior.covariances]),
        np.concatenate([(1 - wrong) * image.weights, wrong * prior.weights]),
        prior.priors,
    )
