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
    """

    images: Transforms
    centre: FloatArray
    freedom: float
    _components: list[tuple[int, FloatArray, Covariances, int]] = field(init=False, default_factory=list)

    def add(self, k: int, mean: FloatArray, covariance: Covariances, count: int) -> None:
        """Record the samples drawn from a component about maximum ``k``; equal components are merged."""
        for row, (owner, m, C, drawn) in enumerate(self._components):
            if owner == k and np.array_equal(m, mean) and np.array_equal(C, covariance):
                self._components[row] = k, m, C, drawn + count
                return
        self._components.append((k, mean.copy(), covariance.copy(), count))

    def counts(self, m: int) -> IntArray:
        """Return the number of samples drawn about each of ``m`` maxima ``(m,)``."""
        counts = np.zeros(m, dtype=np.int64)
        for owner, _, _, count in self._components:
            counts[owner] += count
        return counts

    def log_density(self, bases: Transforms, bends: FloatArray, Ts: Transforms) -> tuple[FloatArray, FloatArray]:
        """Return the log density of the mixture at poses ``(N,)``, and the fraction of each maximum in it ``(N, m)``.

        Symmetric poses are equal: a pose may have been drawn as any of its images.

        Args:
            bases: poses of the maxima ``(m, 4, 4)``.
            bends: bends of the ridges at the maxima ``(m, 6, 6, 6)``.
            Ts: poses at which the density is evaluated ``(N, 4, 4)``.
        """
        components = sorted(self._components, key=lambda c: c[0])
        owners = np.array([c[0] for c in components], dtype=np.int32)
        means, counts = np.array([c[1] for c in components]), np.array([float(c[3]) for c in components])
        L = roots(np.array([c[2] for c in components]))
        inverse = np.ascontiguousarray(np.linalg.inv(L))
        log_w = np.log(counts) - np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
        args = (
            np.ascontiguousarray(bases),
            np.ascontiguousarray(bends),
            owners,
            means,
            inverse,
            log_w,
            self.freedom,
            self.centre,
        )
        log_q, shares = _core.mixture(Ts, *args)
        for turn in self.images:
            other, of_other = _core.mixture(np.ascontiguousarray(Ts @ turn), *args)
            both = np.logaddexp(log_q, other)
            with np.errstate(invalid="ignore"):
                a, b = np.exp(log_q - both), np.exp(other - both)
            shares, log_q = np.nan_to_num(a)[:, None] * shares + np.nan_to_num(b)[:, None] * of_other, both
        return log_q, shares
