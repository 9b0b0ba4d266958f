"""Expected information of readings about part and pose (``math.md`` section 11), and the registry of utilities.

The information has two terms. The first is the mutual information of mode and reading. The density of each mode is a
mixture of small normal densities, so that edges and misses count; the overlaps of pairs are Bhattacharyya coefficients,
as in the bound of Kolchinsky and Tracey (2017). The second is the information about the pose given the mode: half the
log of the ratio of variances, counted as far as it matters for the tolerance.

A utility is a function that rates candidates by their predicted readings. This information is one of those registered.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tanteo import _core
from tanteo.geometry.special import entropy
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.planning.context import DecisionContext
from tanteo.planning.predictions import Predictions, predict
from tanteo.planning.probe import Probe
from tanteo.planning.samples import Samples, draw

SAMPLES = 128
"""Number of samples for the prediction of candidates."""

ALONE, MEANWHILE = 0.01, 0.3
"""Weights of the total information, which is added to the information about the part. The first is for goals without a
pose, where it only decides between equal candidates. The second is for other goals until the part is certain."""


@dataclass(frozen=True, slots=True, eq=False)
class Outlook:
    """Predicted readings of the candidates and their expected information.

    Attributes:
        context: input of the policy.
        samples: samples of the posterior.
        predicted: predicted readings for the samples.
        gain: expected information of each candidate about part and pose ``(C,)`` [nats].
    """

    context: DecisionContext
    samples: Samples
    predicted: Predictions
    gain: FloatArray


Utility: TypeAlias = Callable[[Outlook], FloatArray]
"""Function that rates candidates ``(C,)`` in any unit; a greedy policy chooses the greatest value."""


def outlook(context: DecisionContext) -> Outlook:
    """Predict the readings of all candidates, and compute their expected information.

    Args:
        context: posterior, candidates and goal.
    """
    s = context
    samples = draw(s.state, SAMPLES, s.tolerance, s.feature)
    shared = None if s.shared is None else s.shared(s.candidates)
    predicted = predict(samples, s.candidates.origins, s.candidates.directions, s.probe, shared)
    return Outlook(s, samples, predicted, expected_information(samples, predicted, s.probe))


def information(ahead: Outlook) -> FloatArray:
    """Return the registered utility ``information`` of each candidate ``(C,)`` [nats].

    If the goal is the part only, mainly the information about the part counts. If the goal is part and pose, the
    information about the part has more weight until the part is certain.

    Args:
        ahead: predictions of the candidates.
    """
    s = ahead.context
    if s.part_only or s.part_open:
        share = ALONE if s.part_only else MEANWHILE
        return share * ahead.gain + about_mode(ahead.samples, ahead.predicted, s.probe, ahead.samples.part)
    return ahead.gain


def expected_information(samples: Samples, predicted: Predictions, probe: Probe) -> FloatArray:
    """Return the expected information of each reading about part and pose ``(C,)`` [nats].

    Args:
        samples: samples of the posterior.
        predicted: predicted readings for the samples.
        probe: sensor model.
    """
    return about_mode(samples, predicted, probe) + about_pose(samples, predicted, probe)


def about_pose(samples: Samples, predicted: Predictions, probe: Probe) -> FloatArray:
    """Return the expected information about the pose given the mode ``(C,)`` [nats]; a miss has none.

    Args:
        samples: samples of the posterior.
        predicted: predicted readings for the samples.
        probe: sensor model.
    """
    echo, own = _own(predicted, probe)
    share = np.where(echo > 0, predicted.useful / (predicted.spreads + own), 0.0)
    return np.asarray((-0.5 * np.log1p(-np.minimum(share, 1 - 1e-12)) * echo) @ samples.weights)


def about_mode(samples: Samples, predicted: Predictions, probe: Probe, groups: IntArray | None = None) -> FloatArray:
    """Return the expected information of each reading about the mode ``(C,)`` [nats].

    Args:
        samples: samples of the posterior.
        predicted: predicted readings for the samples.
        probe: sensor model.
        groups: group of every sample, such as its part, to discriminate groups instead of modes ``(S,)``.
    """
    groups = samples.mode if groups is None else groups
    names, group = np.unique(groups, return_inverse=True)
    if len(names) < 2:
        return np.zeros(len(predicted.ranges))
    echo, own = _own(predicted, probe)
    w, answers = echo * samples.weights, echo > 0
    variances = np.where(answers, predicted.variances + own, 1.0)
    means = np.where(answers, predicted.ranges, 0.0)
    return np.asarray(about_hit(w, samples, groups) + _core.group_information(w, means, variances, group))


def about_hit(w: FloatArray, samples: Samples, groups: IntArray) -> FloatArray:
    """Return the information about the group from the presence of an echo alone ``(C,)`` [nats].

    Args:
        w: probability of every sample times the probability of an echo at it ``(C, S)``.
        samples: samples of the posterior.
        groups: group of every sample ``(S,)``.
    """
    names, group = np.unique(groups, return_inverse=True)
    member = (group[:, None] == np.arange(len(names))).astype(np.float64)
    total, hits = samples.weights @ member, w @ member
    miss = _binary_entropy(w.sum(axis=1)) - _binary_entropy(hits / total) @ total
    return np.asarray(np.maximum(miss, 0.0))


def _binary_entropy(chance: FloatArray) -> FloatArray:
    """Return the binary entropy [nats]."""
    return entropy(chance) + entropy(np.maximum(1 - chance, 0.0))


def _own(predicted: Predictions, probe: Probe) -> tuple[FloatArray, FloatArray]:
    """Return the probability of an echo, and the variance of the reading without that of the pose ``(C, S)``."""
    answers = predicted.hit & probe.answers(predicted.ranges, predicted.cosines)
    ranges, cosines = np.where(answers, predicted.ranges, 1.0), np.where(answers, predicted.cosines, 1.0)
    shared = np.where(np.isnan(predicted.shared), probe.shared_variance(cosines), predicted.shared)
    own = probe.own_variance(ranges, cosines) + shared
    return np.where(answers, predicted.shares, 0.0), own + predicted.scatter


UTILITIES: dict[str, Utility] = {"information": information}
"""Utilities by name."""
