"""Mixture of all Student-t components from which samples of one part were drawn."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.posterior.sampling.widths import roots


@dataclass(slots=True, eq=False)
class Mixture:
    """Components and the number of samples drawn from each.

    Attributes:
        images: motions other than the identity that map the part onto itself ``(K, 4, 4)``.
        centre: point of the part about which components turn ``(3,)`` [m].
        freedom: degrees of freedom of the Student-t components.
        owners: maximum of each component ``(C,)``.
        bases: poses relative to which the components are ``(C, 4, 4)``.
        bends: bends of the ridges there; zero without a bend ``(C, 6, 6, 6)``.
        means: their means, as straight motions ``(C, 6)``.
        covariances: their covariances ``(C, 6, 6)``.
        drawn: number of samples drawn from each ``(C,)``.
    """

    images: Transforms
    centre: FloatArray
    freedom: float
    owners: IntArray = field(init=False)
    bases: Transforms = field(init=False)
    bends: FloatArray = field(init=False)
    means: FloatArray = field(init=False)
    covariances: Covariances = field(init=False)
    drawn: IntArray = field(init=False)

    def __post_init__(self) -> None:
        self.owners, self.drawn = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        self.bases, self.bends = np.zeros((0, 4, 4)), np.zeros((0, 6, 6, 6))
        self.means, self.covariances = np.zeros((0, 6)), np.zeros((0, 6, 6))

    def __len__(self) -> int:
        return len(self.owners)

    def add(
        self,
        owners: IntArray,
        bases: Transforms,
        bends: FloatArray,
        means: FloatArray,
        covariances: Covariances,
        drawn: IntArray,
    ) -> None:
        """Record the samples drawn from some components."""
        self.owners, self.drawn = np.concatenate([self.owners, owners]), np.concatenate([self.drawn, drawn])
        self.bases, self.bends = np.concatenate([self.bases, bases]), np.concatenate([self.bends, bends])
        self.means = np.concatenate([self.means, means])
        self.covariances = np.concatenate([self.covariances, covariances])

    def counts(self, m: int) -> IntArray:
        """Return the number of samples drawn about each of ``m`` maxima ``(m,)``."""
        return np.bincount(self.owners, self.drawn, minlength=m).astype(np.int64)

    def log_density(self, Ts: Transforms, m: int, first: int = 0) -> tuple[FloatArray, FloatArray]:
        """Return the log density of the mixture at poses ``(N,)``, and the fraction of each maximum in it ``(N, m)``.

        Symmetric poses are equal: a pose may have been drawn as any of its images.

        Args:
            Ts: poses at which the density is evaluated ``(N, 4, 4)``.
            m: number of maxima.
            first: first component that counts.
        """
        L = roots(self.covariances[first:])
        inverse = np.ascontiguousarray(np.linalg.inv(L))
        log_w = np.log(self.drawn[first:]) - np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
        args = (
            self.bases[first:], self.bends[first:], self.owners[first:], m, self.means[first:], inverse, log_w,
            self.freedom, self.centre,
        )  # fmt: skip
        log_q, shares = _core.mixture(Ts, *args)
        for turn in self.images:
            other, of_other = _core.mixture(np.ascontiguousarray(Ts @ turn), *args)
            log_q, shares = joined(log_q, shares, other, of_other)
        return log_q, shares


def joined(
    log_q: FloatArray, shares: FloatArray, other: FloatArray, of_other: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the log of the sum of two densities at the same poses ``(N,)``, and the fractions in it ``(N, m)``.

    Args:
        log_q: log of the first density ``(N,)``.
        shares: fraction of each maximum in it ``(N, m)``.
        other: log of the second density ``(N,)``.
        of_other: fraction of each maximum in it ``(N, m)``.
    """
    both = np.logaddexp(log_q, other)
    with np.errstate(invalid="ignore"):
        a, b = np.exp(log_q - both), np.exp(other - both)
    return both, np.nan_to_num(a)[:, None] * shares + np.nan_to_num(b)[:, None] * of_other
