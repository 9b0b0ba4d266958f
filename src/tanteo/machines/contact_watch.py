"""Detect a probe that never triggers: touches without a contact where every likely pose of the part has one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

from tanteo.machines.protocol import Sensed
from tanteo.planning import SensingState, Session
from tanteo.planning.predictions import predict
from tanteo.planning.samples import draw

_ALPHA = 0.01
"""Level of a test, the default of ``--significance``. A less probable miss counts as one of this probability."""
_TOUCHES = 2
"""Number of misses of that probability after which a run ends: one may be an error of the prior or of the machine."""
_SAMPLES = 128
"""Number of poses that represent the posterior, so that each has a smaller probability than ``_ALPHA``."""


@dataclass(slots=True, eq=False)
class ContactWatch:
    """Probability of the touches without contact since the last contact, if the probe works.

    The poses are those of the posterior before the first of these touches: the posterior after them already explains
    them by another pose. The probabilities of the touches are multiplied.
    """

    _state: SensingState | None = field(init=False, default=None)
    _probability: float = field(init=False, default=1.0)
    _count: int = field(init=False, default=0)

    def missed(self, session: Session, sensed: Sensed) -> str:
        """Take one touch; return the reason to stop for messages, or an empty text.

        Args:
            session: session before it has received the touch.
            sensed: touch.
        """
        if sensed.hit:
            self._state, self._probability, self._count = None, 1.0, 0
            return ""
        self._state = session.state if self._state is None else self._state
        self._count += 1
        self._probability *= max(_chance_of_miss(self._state, session, sensed), _ALPHA)
        if self._probability > _ALPHA**_TOUCHES * (1 + 1e-9):
            return ""
        return (
            f"the last {self._count} touches made no contact where every likely pose of the part has one. The probe's "
            "circuit is open, or the part is not where its prior states. Trigger the probe by hand, and check that the "
            "controller reports a contact."
        )


def _chance_of_miss(state: SensingState, session: Session, sensed: Sensed) -> float:
    """Return the probability that a working probe makes no contact on a motion."""
    samples = draw(state, _SAMPLES)
    if not len(samples):
        return 1.0
    found = predict(samples, sensed.start[None], sensed.direction[None], session.probe)
    sds = np.sqrt(np.maximum(found.variances[0], session.probe.law.sigma(np.asarray(sensed.reach)) ** 2))
    hits = np.where(found.hit[0], ndtr((sensed.reach - found.ranges[0]) / sds), 0.0)
    return float(1.0 - samples.weights @ hits)
