"""Uncertainty budget: contribution of each source of error to the uncertainty of the pose.

To first order the pose is a linear estimate ``x = G r`` from the rows of the readings. A source with covariance ``S``
of the rows adds ``G S G'`` to the covariance of the pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tanteo.features import shared_root
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers import corner_moves, part_scale, prior_rows, symmetry_motions
from tanteo.render.html.contacts import Contacts, Sensed
from tanteo.sensors.error_states import FaceOffset

_KNOWN = 0.3
"""Standard deviation above which a direction counts as unobserved, as a fraction of the part's size or in rad."""


@dataclass(frozen=True, slots=True)
class Source:
    """Source of error.

    Attributes:
        name: name for the report.
        kind: type of evaluation in the GUM (JCGM 100:2008): ``A`` from the scatter of these readings, ``B`` stated or
            prior.
        share: fraction of the variance of the most uncertain corner; the fractions of a budget sum to one.
        sd: standard deviation of that corner from this source alone [m].
        without: largest corner sd without this source [m]; NaN if some reading has no noise then.
    """

    name: str
    kind: str
    share: float
    sd: float
    without: float


@dataclass(frozen=True, slots=True)
class Budget:
    """Sources of the uncertainty at the most uncertain corner of the part's box.

    Attributes:
        sources: sources, the largest first.
        total: largest corner sd of the budget [m].
    """

    sources: tuple[Source, ...]
    total: float


def make_budget(
    contacts: Contacts,
    sensed: Sensed,
    part: Part,
    T_world_part: Transforms,
    noise_scale: float = 1.0,
    covariance: Covariances | None = None,
) -> Budget | None:
    """Return the budget of a pose, or None if no direction of the pose is observed.

    Args:
        contacts: residuals of the readings for the pose.
        sensed: same readings with their shared errors.
        part: part of the hypothesis.
        T_world_part: pose of the hypothesis ``(4, 4)``.
        noise_scale: ratio of the estimated to the stated noise.
        covariance: covariance of the answer, which also has the errors that are assumed because they are not stated
            ``(6, 6)``; None without these.
    """
    used = contacts.used[contacts.reading]
    known = prior_rows(sensed.prior, part, T_world_part[None])[1][0]
    H, terms = np.concatenate([contacts.rows[used], known]), _terms(contacts, sensed, used, len(known), noise_scale)
    basis = _observed(H, _together(terms).own, part)
    if not basis.shape[1]:
        return None
    stated = _covariance(H, basis, terms)
    assumed = np.zeros((6, 6))
    if covariance is not None and sensed.measured.unstated:
        assumed = _excess(covariance, stated, basis)
    J, total = _worst_corner(part, stated + assumed)
    G = basis @ _estimator(H @ basis, _together(terms))
    sds = {name: float(np.sqrt(J @ _sandwich(G, term) @ J)) for name, term in terms.items()}
    found = [
        Source(name, _kind(name, noise_scale), (sd / total) ** 2, sd, _left(H, basis, terms, name, part, assumed))
        for name, sd in sds.items()
    ]
    if assumed.any():
        sd = float(np.sqrt(J @ assumed @ J))
        found.append(Source(_UNSTATED, "B", (sd / total) ** 2, sd, _worst_corner(part, stated)[1]))
    return Budget(tuple(sorted(found, key=lambda s: -s.share)), total)


_SENSOR, _ROBOT, _SCALE = "noise of the sensor", "repeatability of the robot", "noise scale: scatter beyond the stated"
_FORM, _UNSTATED = "form of the part", "assumed, because not stated: scale, drift, warp"


def _kind(name: str, noise_scale: float) -> str:
    """Return the GUM type of a source: A for the noise scale, and for noise that is smaller than stated."""
    return "A" if name == _SCALE or (noise_scale < 1 and name in (_SENSOR, _ROBOT)) else "B"


@dataclass(frozen=True, slots=True, eq=False)
class _Spread:
    """Covariance of the rows: independent variances ``(m,)`` and a factor of the shared part ``(m, k)``."""

    own: FloatArray
    common: FloatArray


def _terms(contacts: Contacts, sensed: Sensed, used: BoolArray, known: int, noise_scale: float) -> dict[str, _Spread]:
    """Return every source on the rows of the readings, followed by the rows of the prior."""
    m = int(used.sum())

    def term(own: FloatArray | None = None, common: FloatArray | None = None) -> _Spread:
        none = np.zeros((m, 0))
        factor = np.pad(none if common is None else common, ((0, known), (0, 0)))
        return _Spread(np.pad(np.zeros(m) if own is None else own, (0, known)), factor)

    stated = min(noise_scale, 1.0) ** 2
    out = {_SENSOR: term(stated * contacts.noise[used])}
    if contacts.repeatability[used].any():
        out[_ROBOT] = term(stated * contacts.repeatability[used])
    if noise_scale > 1:
        out[_SCALE] = term((noise_scale**2 - 1) * (contacts.noise + contacts.repeatability)[used])
    for error, gain in zip(sensed.measured.shared, contacts.shared_jacobian, strict=True):
        of_form = error.name == FaceOffset.name
        own = sensed.tolerance**2 * contacts.is_distance[used].astype(np.float64) if of_form else None
        out[_FORM if of_form else f"{error.name} (shared)"] = term(own, gain[used] @ shared_root([error]))
    if known:
        out["prior"] = _Spread(np.r_[np.zeros(m), np.ones(known)], np.zeros((m + known, 0)))
    return out


def _together(terms: Mapping[str, _Spread]) -> _Spread:
    """Return the sum of the sources."""
    own = np.sum([term.own for term in terms.values()], axis=0)
    return _Spread(own, np.concatenate([term.common for term in terms.values()], axis=1))


def _observed(H: FloatArray, variances: FloatArray, part: Part) -> FloatArray:
    """Return a basis of the observed motions without spins of symmetry ``(6, k)`` [m, rad]."""
    scale = part_scale(part)
    rows, turns = H @ scale / np.sqrt(variances)[:, None], symmetry_motions(part)
    rows = rows - rows @ turns.T @ turns
    values, vectors = np.linalg.eigh(rows.T @ rows)
    return np.asarray(scale @ vectors[:, values > 1 / _KNOWN**2])


def _estimator(H: FloatArray, spread: _Spread) -> FloatArray:
    """Return the linear unbiased estimator of the motion from the rows ``(k, m)``, optimal for a covariance."""
    D, U = spread.own, spread.common
    W = H / D[:, None]
    if U.shape[1]:
        weighted = U / D[:, None]
        W = W - weighted @ np.linalg.solve(np.eye(U.shape[1]) + U.T @ weighted, U.T @ W)
    return np.asarray(np.linalg.solve(W.T @ H, W.T))


def _sandwich(G: FloatArray, spread: _Spread) -> FloatArray:
    shared = G @ spread.common
    return np.asarray((G * spread.own) @ G.T + shared @ shared.T)


def _covariance(H: FloatArray, basis: FloatArray, terms: Mapping[str, _Spread]) -> Covariances:
    """Return the covariance of the pose along the observed motions."""
    G = basis @ _estimator(H @ basis, _together(terms))
    return np.sum([_sandwich(G, term) for term in terms.values()], axis=0)


def _excess(whole: Covariances, stated: Covariances, basis: FloatArray) -> Covariances:
    """Return the part of a covariance beyond another one, along the observed motions ``(6, 6)``."""
    across = np.linalg.pinv(basis)
    values, vectors = np.linalg.eigh(across @ (whole - stated) @ across.T)
    root = basis @ (vectors * np.sqrt(values.clip(0.0)))
    return np.asarray(root @ root.T)


def _left(
    H: FloatArray, basis: FloatArray, terms: Mapping[str, _Spread], name: str, part: Part, assumed: Covariances
) -> float:
    """Return the largest corner sd without one source; NaN if a row has no noise then."""
    gone = (name, _SCALE) if name == _SENSOR else (name,)  # the noise scale multiplies this noise
    rest = {other: term for other, term in terms.items() if other not in gone}
    if not rest or not np.all(_together(rest).own > 0):
        return float("nan")
    return _worst_corner(part, _covariance(H, basis, rest) + assumed)[1]


def _worst_corner(part: Part, C: Covariances) -> tuple[FloatArray, float]:
    """Return the Jacobian of the most uncertain corner along its worst direction ``(6,)``, and its sd [m]."""
    J = corner_moves(part)
    values, vectors = np.linalg.eigh(J @ C @ np.swapaxes(J, 1, 2))
    k = int(np.argmax(values[:, 2]))
    return vectors[k, :, 2] @ J[k], float(np.sqrt(max(values[k, 2], 0.0)))
