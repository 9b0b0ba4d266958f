"""The uncertainty budget: which error makes how much of what is not known of the pose.

To first order the pose is a linear estimate ``x = G r`` from the rows of the readings. Every source of error adds
``G S G'`` to its covariance, ``S`` being what the source does to the rows; these add up to the whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tanteo.features import shared_root
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior import corner_moves, part_scale, prior_rows, symmetry_motions
from tanteo.render.html.contacts import Contacts, Sensed

_KNOWN = 0.3
"""Directions known worse than this share of the part's size (or radian) count as not observed."""


@dataclass(frozen=True, slots=True)
class Source:
    """One source of error.

    Attributes:
        name: In words.
        kind: Type in the GUM (JCGM 100:2008): ``A`` from the scatter of these readings, ``B`` stated or known before.
        share: Of the variance of the corner that is known worst; the shares of a budget sum to one.
        sd: What the source alone does to the largest corner sd, one standard deviation [m].
        without: Largest corner sd if this error were not there [m]; NaN where that leaves nothing.
    """

    name: str
    kind: str
    share: float
    sd: float
    without: float


@dataclass(frozen=True, slots=True)
class Budget:
    """Where the uncertainty at the worst-known corner of the part's box comes from.

    Attributes:
        sources: The largest first.
        total: Largest corner sd by this budget [m].
    """

    sources: tuple[Source, ...]
    total: float


def make_budget(
    contacts: Contacts, sensed: Sensed, part: Part, T_world_part: Transforms, noise_scale: float = 1.0
) -> Budget | None:
    """The budget of a pose; None where nothing of the pose is observed.

    Args:
        contacts: The readings on the part.
        sensed: The same readings, with the covariances of the errors that they share.
        part: The part.
        T_world_part: The pose.
        noise_scale: Times the stated noise that the readings have.
    """
    used = contacts.used[contacts.reading]
    known = prior_rows(sensed.prior, part, T_world_part[None])[1][0]
    H, terms = np.concatenate([contacts.rows[used], known]), _terms(contacts, sensed, used, len(known), noise_scale)
    basis = _observed(H, _assumed(terms).own, part)
    if not basis.shape[1]:
        return None
    J, total = _worst_corner(part, _covariance(H, basis, terms))
    G = basis @ _estimator(H @ basis, _assumed(terms))
    sds = {name: float(np.sqrt(J @ _sandwich(G, term.real) @ J)) for name, term in terms.items()}
    found = [
        Source(name, _kind(name, noise_scale), (sd / total) ** 2, sd, _left(H, basis, terms, name, part))
        for name, sd in sds.items()
    ]
    return Budget(tuple(sorted(found, key=lambda s: -s.share)), total)


_SENSOR, _ROBOT, _SCALE = "noise of the sensor", "repeatability of the robot", "noise scale: scatter beyond the stated"


def _kind(name: str, noise_scale: float) -> str:
    """The scatter of the readings tells the noise scale; noise below the stated comes from it as well."""
    return "A" if name == _SCALE or (noise_scale < 1 and name in (_SENSOR, _ROBOT)) else "B"


@dataclass(frozen=True, slots=True, eq=False)
class _Spread:
    """A covariance of the rows: variances of their own ``(m,)`` and a factor of what they share ``(m, k)``."""

    own: FloatArray
    common: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """What a source does to the rows, and what the estimator's weights assume of it."""

    real: _Spread
    assumed: _Spread


def _terms(contacts: Contacts, sensed: Sensed, used: BoolArray, known: int, noise_scale: float) -> dict[str, _Term]:
    """Every source, on the rows of the readings and those of what was known beforehand after them."""
    m = int(used.sum())

    def term(own: FloatArray | None = None, common: FloatArray | None = None) -> _Term:
        none = np.zeros((m, 0))
        factor = np.pad(none if common is None else common, ((0, known), (0, 0)))
        spread = _Spread(np.pad(np.zeros(m) if own is None else own, (0, known)), factor)
        return _Term(spread, spread)

    stated = min(noise_scale, 1.0) ** 2
    out = {_SENSOR: term(stated * contacts.noise[used])}
    if contacts.repeatability[used].any():
        out[_ROBOT] = term(stated * contacts.repeatability[used])
    if noise_scale > 1:
        out[_SCALE] = term((noise_scale**2 - 1) * (contacts.noise + contacts.repeatability)[used])
    for error, gain in zip(sensed.measured.shared, contacts.shared_jacobian, strict=True):
        out[f"{error.name} (shared)"] = term(common=gain[used] @ shared_root([error]))
    if sensed.tolerance > 0:
        alone = term(np.where(np.any(contacts.form[used] != 0, axis=1), sensed.tolerance**2, 0.0))
        whole = term(alone.real.own[:m] * contacts.labelled, sensed.tolerance * contacts.form[used])
        # unlabelled readings are weighed as if each deviated by itself; what a face does as a whole is added afterwards
        out["tolerance of the part"] = _Term(whole.real, (whole if contacts.labelled else alone).assumed)
    if known:
        beforehand = _Spread(np.r_[np.zeros(m), np.ones(known)], np.zeros((m + known, 0)))
        out["what was known beforehand"] = _Term(beforehand, beforehand)
    return out


def _assumed(terms: Mapping[str, _Term]) -> _Spread:
    """All that the weights assume, together."""
    own = np.sum([term.assumed.own for term in terms.values()], axis=0)
    return _Spread(own, np.concatenate([term.assumed.common for term in terms.values()], axis=1))


def _observed(H: FloatArray, variances: FloatArray, part: Part) -> FloatArray:
    """Basis ``(6, k)`` of the motions that the rows resist and that no symmetry excuses [m, rad]."""
    scale = part_scale(part)
    rows, turns = H @ scale / np.sqrt(variances)[:, None], symmetry_motions(part)
    rows = rows - rows @ turns.T @ turns
    values, vectors = np.linalg.eigh(rows.T @ rows)
    return np.asarray(scale @ vectors[:, values > 1 / _KNOWN**2])


def _estimator(H: FloatArray, spread: _Spread) -> FloatArray:
    """Linear unbiased estimator ``(k, m)`` of the motion from the rows, best if the spread is true."""
    D, U = spread.own, spread.common
    W = H / D[:, None]
    if U.shape[1]:
        weighted = U / D[:, None]
        W = W - weighted @ np.linalg.solve(np.eye(U.shape[1]) + U.T @ weighted, U.T @ W)
    return np.asarray(np.linalg.solve(W.T @ H, W.T))


def _sandwich(G: FloatArray, spread: _Spread) -> FloatArray:
    shared = G @ spread.common
    return np.asarray((G * spread.own) @ G.T + shared @ shared.T)


def _covariance(H: FloatArray, basis: FloatArray, terms: Mapping[str, _Term]) -> Covariances:
    """Of the pose, along what is observed."""
    G = basis @ _estimator(H @ basis, _assumed(terms))
    return np.sum([_sandwich(G, term.real) for term in terms.values()], axis=0)


def _left(H: FloatArray, basis: FloatArray, terms: Mapping[str, _Term], name: str, part: Part) -> float:
    """Largest corner sd without one source; NaN if the others leave a row without noise."""
    gone = (name, _SCALE) if name == _SENSOR else (name,)  # the scale is of this noise
    rest = {other: term for other, term in terms.items() if other not in gone}
    if not rest or not np.all(_assumed(rest).own > 0):
        return float("nan")
    return _worst_corner(part, _covariance(H, basis, rest))[1]


def _worst_corner(part: Part, C: Covariances) -> tuple[FloatArray, float]:
    """How a motion moves the box's largest corner sd along its worst direction ``(6,)``, and the sd of that [m]."""
    J = corner_moves(part)
    values, vectors = np.linalg.eigh(J @ C @ np.swapaxes(J, 1, 2))
    k = int(np.argmax(values[:, 2]))
    return vectors[k, :, 2] @ J[k], float(np.sqrt(max(values[k, 2], 0.0)))
