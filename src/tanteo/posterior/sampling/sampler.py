"""Adaptive mixture importance sampling of the posterior of one part, about all of its maxima at once.

Each maximum has Student-t components (Owen and Zhou 2000; Cornuet et al. 2012, deterministic mixture weights). The
weight of a sample is relative to the mixture of all components ever used. So overlapping modes share their samples and
nothing is counted twice. Shared errors and the noise scale are integrated at each pose by Laplace's method.

Few measurements leave ridges that are bent: a turn about one touched point moves the others along circles. Components
are therefore Student-t in straight coordinates, ``x - bend(x, x)`` for a motion ``x`` from the maximum. The bend of the
narrow directions is quadratic in the wide ones, so that volumes are equal. Where a component has few effective samples,
it is replaced by pieces: components about samples that are drawn by their weights, each with the curvature and bend at
its place (West 1993; Cappe et al. 2004, population Monte Carlo).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms
from tanteo.posterior.sampling.control_variate import ControlVariate
from tanteo.posterior.sampling.density import Density
from tanteo.posterior.sampling.mixture import Mixture, joined
from tanteo.posterior.sampling.peaks import Objective, Peaks
from tanteo.posterior.sampling.widths import Axes, narrowed, roots
from tanteo.posterior.settings import POSE_DOF, SampleSettings
from tanteo.posterior.truncated_normal import truncate_by_box
from tanteo.sensors.error_states import stepped_amounts

_COMPARABLE = 30.0
"""Numerical: log of the ratio of two masses beyond which the smaller is lost by rounding, 1e-13."""

_NEGLIGIBLE_SHARE = 1e-9
"""Numerical: share of a component in the mixture density below which a sample is not of its region."""

_NEGLIGIBLE_WEIGHT = -200.0
"""Numerical: log of a weight over the largest below which it is zero: products of smaller numbers are subnormal, and
processors multiply these a hundred times slower."""


@dataclass(slots=True, eq=False)
class Sampler:
    """Sampler of the posterior of one part.

    Attributes:
        objective: the part and the problem.
        peaks: maxima, the centres of the components.
        rng: generator of all draws.
        log_constant: log of the constant factors of the prior, symmetric poses included.
        along: poses on a ridge that are no maxima, for components if the maxima are not normal; None without.
        trusted: whether the curvature alone sets the widths of first components, if no face ends within them.
        density: target density.
        Ts: samples ``(N, 4, 4)``.
        zs: other states at the samples ``(N, D)``.
        log_target: log of the target density at the samples ``(N,)``.
        log_weights: log of the importance weights ``(N,)``.
        log_density: log of the mixture density at the samples ``(N,)``.
        shares: fraction of each maximum in the mixture density at the samples ``(N, m)``.
        bends: bends of the ridges at the maxima; zero without a bend ``(m, 6, 6, 6)``.
        means: means of the components, as straight motions from their maxima ``(m, 6)`` [m, rad].
        covariances: covariances of the components ``(m, 6, 6)`` [m, rad].
        local: whether each component is a piece of a ridge ``(m,)``.
        in_pieces: whether the component of each maximum is replaced by pieces ``(m,)``.
    """

    objective: Objective
    peaks: Peaks
    rng: np.random.Generator
    log_constant: float
    along: Peaks | None = None
    trusted: bool = False
    density: Density = field(init=False)
    Ts: Transforms = field(init=False)
    zs: FloatArray = field(init=False)
    log_target: FloatArray = field(init=False)
    log_weights: FloatArray = field(init=False)
    log_density: FloatArray = field(init=False)
    shares: FloatArray = field(init=False)
    bends: FloatArray = field(init=False)
    means: FloatArray = field(init=False)
    covariances: Covariances = field(init=False)
    _mixture: Mixture = field(init=False)
    _weighed: tuple[int, int] = field(init=False, default=(0, 0))
    _log_mixture: FloatArray = field(init=False)
    _slopes: FloatArray = field(init=False)
    _tops: FloatArray = field(init=False)
    local: BoolArray = field(init=False)
    in_pieces: BoolArray = field(init=False)
    _fitted: BoolArray = field(init=False)
    _masses: tuple[FloatArray, FloatArray] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        D, peaks = self.objective.problem.states, self.peaks
        self.Ts, self.zs = np.zeros((0, 4, 4)), np.zeros((0, D))
        self.log_target, self.log_weights, self.log_density = np.zeros(0), np.zeros(0), np.zeros(0)
        self.shares, self._log_mixture = np.zeros((0, len(peaks))), np.zeros(0)
        self.means, self.covariances, self._slopes, cut = self._about(peaks)
        self.bends = np.zeros((len(peaks), 6, 6, 6))
        self._tops, self.in_pieces = np.full(len(peaks), np.nan), np.zeros(len(peaks), dtype=bool)
        prepared = self.objective.prepared
        self._mixture = Mixture(prepared.part.symmetry.Ts[1:], prepared.shape.centre, self.settings.freedom)
        self._fitted, self.local = cut | self.trusted, np.zeros(len(peaks), dtype=bool)
        self.density = Density.about(self.objective, peaks.Ts[0], self.log_constant)

    @property
    def settings(self) -> SampleSettings:
        """Return the settings of the sampler."""
        return self.objective.problem.settings.samples

    def _about(self, peaks: Peaks) -> tuple[FloatArray, Covariances, FloatArray, BoolArray]:
        """Return the first components about maxima: means, covariances, slopes of other states, cut by a box or not.

        Shapes are ``(m, 6)``, ``(m, 6, 6)``, ``(m, D, 6)`` and ``(m,)``.
        """
        H = self.objective.of_pose(peaks.information)
        covariances = np.asarray(self.settings.inflation * np.linalg.inv(H), dtype=np.float64)
        means, covariances, cut = truncate_by_box(self.objective, peaks.Ts, covariances)
        full = self.objective.regular(peaks.information)
        if full.shape[-1] == 6:
            return means, covariances, np.zeros((len(peaks), 0, 6)), cut
        slopes = np.asarray(-np.linalg.solve(full[:, 6:, 6:], full[:, 6:, :6]), dtype=np.float64)
        return means, covariances, slopes, cut

    def add(self, peaks: Peaks) -> None:
        """Add maxima, whose components follow the existing ones; they have no samples yet."""
        means, covariances, slopes, cut = self._about(peaks)
        self.peaks, self._masses = self.peaks.join(peaks), None
        self.covariances = np.concatenate([self.covariances, covariances])
        self.means = np.concatenate([self.means, means])
        self.bends = np.concatenate([self.bends, np.zeros((len(peaks), 6, 6, 6))])
        self.in_pieces = np.concatenate([self.in_pieces, np.zeros(len(peaks), dtype=bool)])
        self._tops = np.concatenate([self._tops, np.full(len(peaks), np.nan)])
        self._slopes = np.concatenate([self._slopes, slopes])
        self.shares = np.pad(self.shares, ((0, 0), (0, len(peaks))))
        self._fitted, self.local = np.concatenate([self._fitted, cut]), np.concatenate([self.local, np.zeros_like(cut)])

    @property
    def fixes_pose(self) -> bool:
        """Whether there are enough measurements for the pose of the part."""
        return self.objective.problem.may_fix(self.objective.prepared.part)

    def counts(self) -> IntArray:
        """Return the number of samples drawn from each component ``(m,)``."""
        return self._mixture.counts(len(self.peaks))

    def weights(self, top: float) -> FloatArray:
        """Return the importance weights over the number whose log is ``top``; negligible ones are zero ``(N,)``."""
        log = self.log_weights - top
        return np.where(log > _NEGLIGIBLE_WEIGHT, np.exp(np.maximum(log, _NEGLIGIBLE_WEIGHT)), 0.0)

    def spread(self, along: Peaks, count: int) -> None:
        """Add components at poses along a bent ridge that are no maxima, and draw samples from each."""
        self.add(along)
        self.local[-len(along) :] = True
        self.sample(count * self.local)

    def unexplained(self) -> IntArray:
        """Return rows of samples whose weight is so large that a component is missing there ``(K,)``."""
        w = self.weights(float(self.log_weights.max()))
        rows = np.flatnonzero(w > self.settings.min_fraction * w.sum())
        return rows[np.argsort(-w[rows])]

    def sample(self, counts: IntArray) -> None:
        """Draw further samples of each maximum ``(m,)``, and recompute all weights."""
        on = np.flatnonzero(counts)
        if not len(on):
            return
        new = on[np.isnan(self._tops[on])]
        if len(new):
            self._tops[new] = self.density.at(np.ascontiguousarray(self.peaks.Ts[new]), self.peaks.zs[new])[0]
        whole, ridges = on[~self.in_pieces[on]], on[self.in_pieces[on]]
        self._fit_widths(whole[~self._fitted[whole]], counts)
        drawn = []
        if len(whole):
            bases, bends, slopes = self.peaks.take(whole), self.bends[whole], self._slopes[whole]
            means, covariances = self.means[whole], self.covariances[whole]
            drawn.append(self._drawn(whole, bases, bends, means, covariances, slopes, counts[whole]))
        if len(ridges):
            drawn.append(self._drawn_along(ridges, counts[ridges]))
        self.Ts = np.concatenate([self.Ts, *(Ts for Ts, _, _ in drawn)])
        self.zs = np.concatenate([self.zs, *(zs for _, zs, _ in drawn)])
        self.log_target = np.concatenate([self.log_target, *(log for _, _, log in drawn)])
        self._weigh()

    def _drawn_along(self, which: IntArray, counts: IntArray) -> tuple[Transforms, FloatArray, FloatArray]:
        """Draw samples from pieces of ridges: components about earlier samples, drawn by their weights.

        Args:
            which: maxima of the ridges ``(R,)``.
            counts: number of samples to draw of each ``(R,)``.

        Returns:
            Poses, other states and log densities.
        """
        w, size = self.weights(float(self.log_weights.max())), self.settings.heaviest
        nearest, rows, times, owners = np.argmax(self.shares, axis=1), [], [], []
        for k, count in zip(which, counts, strict=True):
            own = np.where(nearest == k, w, 0.0)
            own = np.cumsum(np.minimum(own, own.sum() / self.settings.clip))
            n = max(int(count) // size, 1)
            places = np.searchsorted(own, (self.rng.random() + np.arange(n)) / n * own[-1])
            at, often = np.unique(places.clip(0, len(w) - 1), return_counts=True)
            rows.append(at)
            times.append(often)
            owners.append(np.full(len(at), k))
        all_rows, shape = np.concatenate(rows), self.objective.prepared.shape
        Ts, zs = np.ascontiguousarray(self.Ts[all_rows]), np.ascontiguousarray(self.zs[all_rows])
        logs, _, information = _core.slopes(shape, self.objective.core, Ts, zs)
        none = np.zeros(len(Ts), dtype=np.int64)
        pieces = Peaks(Ts, zs, logs, information, np.full(len(Ts), -np.inf), none)
        means, covariances, slopes, _ = self._about(pieces)
        covariances, bends = self._bent_widths(pieces, slopes, Axes.of(covariances, self._unit))
        counted = size * np.concatenate(times)
        return self._drawn(np.concatenate(owners), pieces, bends, means, covariances, slopes, counted)

    def _drawn(
        self,
        owners: IntArray,
        bases: Peaks,
        bends: FloatArray,
        means: FloatArray,
        covariances: Covariances,
        slopes: FloatArray,
        counts: IntArray,
    ) -> tuple[Transforms, FloatArray, FloatArray]:
        """Draw samples from components, and record these.

        Args:
            owners: maximum of each component ``(C,)``.
            bases: poses relative to which they are ``(C,)``.
            bends: bends of the ridges there ``(C, 6, 6, 6)``.
            means: their means ``(C, 6)``.
            covariances: their covariances ``(C, 6, 6)``.
            slopes: slopes of the other states ``(C, D, 6)``.
            counts: number of samples of each ``(C,)``.

        Returns:
            Poses, other states and log densities.
        """
        L, freedom, n = roots(covariances), self.settings.freedom, int(counts.sum())
        z = self.rng.normal(size=(n, 6)) / np.sqrt(self.rng.chisquare(freedom, size=(n, 1)) / freedom)
        which = np.repeat(np.arange(len(counts)), counts)
        x = means[which] + np.einsum("nij,nj->ni", L[which], z)
        bent = _bent(bends, which, x)
        Ts = self._placed(bases, which, bent)
        log, zs = self.density.at(Ts, self._followed(bases, slopes, which, x))
        log[np.linalg.norm(bent[:, 3:], axis=1) >= np.pi] = -np.inf
        self._mixture.add(owners, bases.Ts, bends, means, covariances, counts)
        return Ts, zs, log

    @property
    def _unit(self) -> FloatArray:
        """Return the units of a motion, with turns as shifts of the rim ``(6,)``."""
        return np.r_[np.ones(3), np.full(3, 4 / self.objective.prepared.part.diagonal)]

    def _fit_widths(self, which: IntArray, counts: IntArray) -> None:
        """Narrow components along axes on which the density falls faster than its curvature implies.

        Where a ridge is bent, components that follow the bend are longer, and replace the straight ones. A component
        without a ridge that gets few samples is not narrowed.

        Args:
            which: indices of components whose widths are those of the curvature.
            counts: number of samples to draw from each component ``(m,)``.
        """
        size = self.objective.prepared.part.diagonal
        new, axes = self.counts()[which] == 0, Axes.of(self.covariances[which], self._unit)
        some = (counts[which] >= self.settings.heaviest) | (new & (axes.widths[:, -1] > self.settings.edge_sd * size))
        which, new, axes = which[some], new[some], axes.take(some)
        if not len(which):
            return
        self._fitted[which] = True
        # samples of the others so far were drawn without a bend
        fitted = self._bent_widths(self.peaks.take(which), self._slopes[which], axes, new)
        self.covariances[which], self.bends[which] = fitted

    def _bent_widths(
        self, bases: Peaks, slopes: FloatArray, axes: Axes, bent: BoolArray | None = None
    ) -> tuple[Covariances, FloatArray]:
        """Return covariances of components, narrowed where the density falls earlier, and bends where those are longer.

        Args:
            bases: poses relative to which the components are ``(C,)``.
            slopes: slopes of the other states ``(C, D, 6)``.
            axes: their axes by the curvature.
            bent: which components may bend ``(C,)``; None for all.

        Returns:
            Covariances ``(C, 6, 6)`` and bends ``(C, 6, 6, 6)``.
        """

        def log_at(bases: Peaks, slopes: FloatArray, bends: FloatArray) -> Callable[[IntArray, FloatArray], FloatArray]:
            """Return log densities at the noise scale of the bases: integrated over it, they have a cusp there."""

            def log(which: IntArray, x: FloatArray) -> FloatArray:
                zs = np.ascontiguousarray(self._regressed(bases, slopes, which, x))
                there = self._placed(bases, which, _bent(bends, which, x))
                shape = self.objective.prepared.shape
                return np.asarray(_core.log_densities(shape, self.objective.core, there, zs))

            return log

        own, bends = self.objective.problem.settings, np.zeros((len(bases), 6, 6, 6))
        straight = narrowed(axes, log_at(bases, slopes, bends), own)
        covariances, shorter = straight.covariances, straight.widths < axes.widths
        short = np.logical_and(shorter.any(axis=1), True if bent is None else bent)
        rows = np.flatnonzero(short)
        if len(rows):
            axes, straight, bases, slopes = axes.take(short), straight.take(short), bases.take(rows), slopes[rows]
            bends[rows] = self._bends(bases, slopes, straight, shorter[rows])
            longer = narrowed(axes, log_at(bases, slopes, bends[rows]), own)
            better = np.log(longer.widths).sum(axis=1) > np.log(straight.widths).sum(axis=1)
            covariances[rows[better]], bends[rows[~better]] = longer.take(better).covariances, 0.0
        return covariances, bends

    def _bends(self, bases: Peaks, states: FloatArray, axes: Axes, wide: BoolArray) -> FloatArray:
        """Return the bends of ridges ``(C, 6, 6, 6)``, from gradients on both sides of their bases.

        Where the narrow directions of the ridge are at ``b(u)`` for a motion ``u`` along the wide ones, the gradient in
        them is ``H b(u)`` more than at the base, and ``b(u)`` is even. So the sum of the gradients at ``u`` and ``-u``
        is ``2 H b(u)`` more than twice that at the base.

        Args:
            bases: bases of the components ``(C,)``.
            states: slopes of the other states ``(C, D, 6)``.
            axes: their axes, as wide as the density is high.
            wide: axes along the ridge ``(C, 6)``.
        """
        objective, wide = self.objective, wide & (np.cumsum(wide[:, ::-1], axis=1)[:, ::-1] <= POSE_DOF // 2)
        steps = axes.scaled  # rows are one width along each axis
        first, second = np.triu_indices(6)
        u = np.where((first == second)[:, None], steps[:, first], steps[:, first] + steps[:, second])
        pairs = wide[:, first] & wide[:, second]
        at, pair = np.nonzero(pairs)
        which = np.concatenate([at, at, some := np.flatnonzero(wide.any(axis=1))])
        x = np.concatenate([u[pairs], -u[pairs], np.zeros((len(some), 6))])
        zs = np.ascontiguousarray(self._regressed(bases, states, which, x))
        there = self._placed(bases, which, x)
        slopes = np.asarray(_core.slopes(objective.prepared.shape, objective.core, there, zs)[1])
        K = slopes.shape[1]
        base, sums = np.zeros((len(bases), K)), np.zeros((*pairs.shape, K))
        base[some] = slopes[2 * len(at) :]
        sums[at, pair] = slopes[: len(at)] + slopes[len(at) : 2 * len(at)] - 2 * base[at]
        full = objective.regular(bases.information)
        others = np.linalg.solve(full[:, 6:, 6:], np.swapaxes(sums[..., 6:], 1, 2))
        gradients = sums[..., :6] - np.swapaxes(full[:, :6, 6:] @ others, 1, 2)
        out, H = np.zeros((len(bases), 6, 6, 6)), objective.of_pose(bases.information)
        for k in some:
            narrow = axes.vectors[k][:, ~wide[k]] * axes.size[:, None]
            off = 0.5 * gradients[k] @ narrow @ np.linalg.inv(narrow.T @ H[k] @ narrow) @ narrow.T
            form = np.zeros((6, 6, 6))
            form[first, second] = off
            own = form[range(6), range(6)]
            cross = 0.5 * (off - own[first] - own[second])
            form[first, second] = form[second, first] = np.where((first == second)[:, None], off, cross)
            form[~wide[k]], form[:, ~wide[k]] = 0.0, 0.0
            dual = axes.vectors[k] / axes.size[:, None] / axes.widths[k]  # coordinates in widths of a motion
            out[k] = np.einsum("abi,ja,kb->ijk", form, dual, dual)
        return out

    def offsets(self, k: int, Ts: Transforms) -> FloatArray:
        """Return the straight motions from a maximum to poses ``(N, 6)``."""
        x = _core.offsets(self.peaks.Ts[k], np.ascontiguousarray(Ts), self.objective.prepared.shape.centre)
        return np.asarray(x - np.einsum("ijk,nj,nk->ni", self.bends[k], x, x))

    def _placed(self, bases: Peaks, which: IntArray, x: FloatArray) -> Transforms:
        """Return poses after motions ``(N, 6)`` from some of the bases."""
        centre = self.objective.prepared.shape.centre
        return _core.place(np.ascontiguousarray(bases.Ts[which]), np.ascontiguousarray(x), centre)

    def _regressed(self, bases: Peaks, slopes: FloatArray, which: IntArray, x: FloatArray) -> FloatArray:
        """Return the other states after motions ``(N, D)`` from some of the bases, by linear regression."""
        from_bases, steps = bases.zs[which], np.einsum("nij,nj->ni", slopes[which], x)
        zs = np.asarray(from_bases + steps)
        if (amounts := np.flatnonzero(self.objective.problem.points.one_sided)).size:
            zs[:, amounts] = stepped_amounts(from_bases[:, amounts], steps[:, amounts])
        return zs

    def _followed(self, bases: Peaks, slopes: FloatArray, which: IntArray, x: FloatArray) -> FloatArray:
        """Return the other states after motions ``(N, D)`` from some of the bases, to start their integration.

        The noise scale is that of the squared residuals there, which grow with the squared distance from the base.
        """
        zs = self._regressed(bases, slopes, which, x)
        if (sd := self.objective.problem.scale_sd) > 0:
            full = bases.information
            squares = np.einsum("ni,nij,nj->n", x, self.objective.of_pose(full)[which], x) - POSE_DOF
            ratio = 2 * sd**2 * squares / np.maximum(full[which, -1, -1], 1.0)  # to the sum of squared residuals
            zs[:, -1] += np.log1p(np.maximum(ratio, -0.5)) / (2 * sd)
        return zs

    def _weigh(self) -> None:
        """Compute the weights of all samples.

        A sample far below the maximum of its component is not of its region. Such poses, where readings are outliers,
        are many, but a component hardly reaches them: one sample would have more weight than all others.
        """
        (n, first), m = self._weighed, len(self.peaks)
        old = self._log_mixture, self.shares
        if n and first < len(self._mixture):
            old = joined(*old, *self._mixture.log_density(self.Ts[:n], m, first))
        log_new, of_new = self._mixture.log_density(self.Ts[n:], m)
        log_q, self.shares = np.concatenate([old[0], log_new]), np.concatenate([old[1], of_new])
        self._log_mixture, self._weighed = log_q, (len(self.Ts), len(self._mixture))
        self.shares[self.shares < _NEGLIGIBLE_SHARE] = 0.0
        least = self._tops[np.argmax(self.shares, axis=1)] - 2 * self.objective.problem.settings.search.drop_gap
        ok = np.isfinite(self.log_target) & np.isfinite(log_q) & ~(self.log_target < least)
        self.log_weights = np.where(ok, self.log_target - np.where(ok, log_q, 0.0), -np.inf)
        self.log_density, self._masses = np.where(np.isfinite(log_q), log_q, np.inf), None

    def adapt(self, which: IntArray, top: float) -> None:
        """Fit components to the weighted samples of their maxima, or replace them by pieces if few samples count.

        Args:
            which: indices of the components.
            top: log of the unit of the weights.
        """
        w, counts = self.weights(top), self.counts()
        for k in which:
            rows = np.flatnonzero(self.shares[:, k] > 1e-3)
            own = w[rows] * self.shares[rows, k]
            enough = counts[k] >= self.settings.shape and own.sum() > 0
            if self.in_pieces[k] or (enough and own.sum() ** 2 < self.settings.min_fraction * counts[k] * (own @ own)):
                self.in_pieces[k] = True
                continue
            own = np.minimum(own, max(own.sum() / self.settings.clip, 1e-300))
            total = own.sum()
            if not total > 0:
                continue
            own /= total
            x = self.offsets(int(k), self.Ts[rows])
            size = 1 / np.sum(own**2)
            trust = size / (size + 2 * POSE_DOF)
            mean = own @ x
            off = x - mean
            self.means[k] = trust * mean + (1 - trust) * self.means[k]
            wide = self.settings.adapted_inflation * (own[:, None] * off).T @ off
            self.covariances[k] = trust * wide + (1 - trust) * self.covariances[k]

    def control_variate(self, k: int, weights: FloatArray) -> ControlVariate:
        """Return the region of a maximum with a normal density of its curvature as control variate.

        Args:
            k: index of the maximum.
            weights: weights of the samples in its region, over the largest of all ``(N,)``.
        """
        mass = float(self.peaks.evidence[k]) + self.log_constant - float(self.log_weights.max())
        few = self.counts()[k] < self.settings.shape  # they do not cover a normal density
        if few or self.in_pieces[k] or self.bends[k].any() or not abs(mass) < _COMPARABLE:
            return ControlVariate.alone(weights, self.settings)
        H = self.objective.of_pose(self.peaks.information[k][None])[0]
        near = np.flatnonzero(self.shares[:, k])
        gaps, own = np.zeros(len(weights)), np.zeros(len(weights))
        gaps[near] = self._squared_gaps(k, H, near)
        log = mass - 3 * np.log(2 * np.pi) + 0.5 * np.linalg.slogdet(H)[1] - 0.5 * gaps[near]
        own[near] = np.exp(np.minimum(log - self.log_density[near], _COMPARABLE))
        outside = own[~np.isfinite(self.log_weights)].sum()
        if outside > self.settings.min_probability * own.sum():  # a box ends in the region
            return ControlVariate.alone(weights, self.settings)
        gate = self.objective.problem.settings.search.gate
        if own.sum() + gate * float(np.sqrt(own @ own)) < np.exp(mass):  # the samples do not cover the normal density
            return ControlVariate.alone(weights, self.settings)
        factor = min(float(weights @ own) / max(float(own @ own), 1e-300), 1.0)
        both = ControlVariate(weights, factor * own, factor * float(np.exp(mass)), gaps, self.settings)
        enough = both.mass > self.settings.min_fraction * weights.sum()
        return both if enough else ControlVariate.alone(weights, self.settings)

    def masses(self) -> tuple[FloatArray, FloatArray]:
        """Return log mass and effective sample size of the region of each maximum ``(m,)``."""
        if self._masses is None:
            self._masses = self._region_masses()
        return self._masses

    def _region_masses(self) -> tuple[FloatArray, FloatArray]:
        top = float(self.log_weights.max())
        if not np.isfinite(top):
            return np.full(len(self.peaks), -np.inf), np.zeros(len(self.peaks))
        W = self.weights(top)[:, None] * self.shares
        sums, squares = W.sum(axis=0), np.sum(W * W, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ess = np.nan_to_num(sums**2 / squares)
            for k in np.flatnonzero(sums > self.settings.region * sums.sum()):
                one = self.control_variate(int(k), W[:, k])
                sums[k], ess[k] = one.mass, one.ess
            return np.log(sums) + top, ess

    def is_normal(self, k: int) -> bool:
        """Return whether the region of a maximum is nearly normal, and its samples suffice to decide it."""
        top = max(float(self.log_weights.max()), np.finfo(np.float64).min)
        return self.control_variate(k, self.weights(top) * self.shares[:, k]).is_normal

    def _squared_gaps(self, k: int, information: FloatArray, rows: IntArray) -> FloatArray:
        """Return squared distances from a maximum to some samples, or to the nearest of their images ``(R,)``."""
        out = np.full(len(rows), np.inf)
        for turn in [None, *self._mixture.images]:
            x = self.offsets(k, self.Ts[rows] if turn is None else self.Ts[rows] @ turn)
            out = np.minimum(out, np.sum((x @ information) * x, axis=1))
        return out


def _bent(bends: FloatArray, which: IntArray, x: FloatArray) -> FloatArray:
    """Return motions ``(N, 6)`` from some bases of straight ones."""
    return np.asarray(x + np.einsum("nijk,nj,nk->ni", bends[which], x, x))
