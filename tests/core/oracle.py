"""The likelihood again, in plain NumPy, from its formulas: the compiled core must agree with it.

Every term is a sum over the faces, edges or corners that a point may be on, of densities relative to an outlier's.
``Cuts`` are the distances in standard deviations at which the core stops the search; without them the terms are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import quad
from scipy.linalg import logm
from scipy.stats import norm

from core.oracle_ball import (
    BESIDE,
    Touch,
    convex_edges,
    convex_vertices,
    log_outside,
    middle,
    over_edges,
    over_vertices,
)
from core.oracle_shape import Flat, any_across, cast, flats_of, share, tangent_plane


@dataclass(frozen=True)
class Cuts:
    """Cut-off distances of the core, as documented in likelihood.cpp; ``box`` refers to the boxes of its tree."""

    reach: float = 6.0
    seen: float = 5.0
    nothing: float = 1e-9
    box: float = 6.0


EXACT = Cuts(np.inf, np.inf, 0.0, np.inf)
GRAZING, CLEARLY, BACK_FACE, BLOCKED, IN_FRONT = 0.02, 0.1, 1e-6, 2e-22, 4.0


def one_sided(z):
    """Return amounts on one side with mean 0 and variance 1: even from none to 0.84, normal above."""

    def h(z):
        return np.where(z < 1, norm.cdf(z), norm.cdf(1) + norm.pdf(1) * (z - 1))

    x = np.linspace(-9, 9, 20_001)
    w = norm.pdf(x) / norm.pdf(x).sum()
    mean = w @ h(x)
    return (h(z) - mean) / np.sqrt(w @ (h(x) - mean) ** 2)


class Oracle:
    """The log density of one question about one body."""

    def __init__(self, body, question, cuts=Cuts()):
        self.body, self.q, self.cuts = body, question, cuts
        self.flats = flats_of(body)
        self.area = 0.5 * np.linalg.norm(body.across, axis=1).sum()
        ends = body.edges.reshape(-1, 2, 3)
        self.lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        self.boxes = np.stack([flat.box for flat in self.flats])
        self.convex = list(convex_edges(body, self.flats))
        self.vertices = convex_vertices(body, self.convex)
        self.sagitta = self._sagitta()

    def log_density(self, T, z):
        """Return the log density of the whole question, prior included."""
        hits = [self.hits(j, T, z) for j in range(len(self.q.points))]
        logs = [np.log(w) + self._log_at_rate(hits, r) for r, w in zip(self.q.rates, self.q.rate_weights, strict=True)]
        log = np.logaddexp.reduce(logs) + self.q.log_outlier.sum()
        return log + self.log_rays(T, z) + self.log_prior(T, z)

    def boxless(self):
        """Return the density without boxes: the core's tree may miss flats whose box is farther than the reach."""
        every = Oracle.__new__(Oracle)
        every.__dict__ = {**self.__dict__, "cuts": replace(self.cuts, box=np.inf)}
        return every

    def hits(self, j, T, z):
        """Return the faces, edges or corners that a point may be on, with densities relative to an outlier's."""
        q, R = self.q, T[:3, :3]
        D = q.shared_jacobian.shape[2]
        sides = q.one_sided if len(q.one_sided) else np.zeros(D)
        p = R.T @ (q.points[j] + q.shared_jacobian[j] @ np.where(sides, one_sided(z[:D]), z[:D]) - T[:3, 3])
        scale = np.exp(q.scale_sd * z[D]) if q.scale_sd > 0 else 1.0
        C = R.T @ (scale**2 * q.covs[j]) @ R + q.extra[j] * np.eye(3)
        of_kind = (
            self.on_faces,
            self.on_edges,
            self.on_corners,
            self.on_axes,
            self.on_faces,
            self.on_axes,
            self.on_axes,
        )
        hits = of_kind[q.kinds[j]](j, p, C, R)
        least = self.cuts.nothing * q.mean_rate
        hits = [(face, np.exp(log - q.log_outlier[j])) for face, log in hits]
        hits = [(face, weight) for face, weight in hits if weight >= least]
        return [] if self.blocked(j, p, R.T @ q.directions[j], C) else hits

    def on_faces(self, j, p, C, R):
        """Integral of the noise over each flat piece: a normal density of the distance, times what falls inside."""
        touches, near = [], []
        widest = np.sqrt(C[0, 0] if self._isotropic(j) else np.trace(C))
        radius, ball = self.q.radii[j], self.q.radii[j] > 0.5 * widest
        off = np.maximum(np.maximum(self.boxes[:, 0] - p, p - self.boxes[:, 1]), 0)
        for i in np.flatnonzero(np.linalg.norm(off, axis=1) <= self.cuts.box * widest + radius + self.sagitta):
            flat = self.flats[i]
            n, distance, bends = tangent_plane(flat, p)
            sd = np.sqrt(n @ C @ n)
            gap = distance - radius
            inside = ball and gap < 0 and distance > -radius
            if abs(gap) > self.cuts.reach * sd and not inside:
                continue
            part = self._share(flat, p, C, n, gap)
            straight = [(0.0, flat.u), (0.0, flat.v)]
            touch = Touch(flat, flat.face, bends is not None, n, middle(flat), gap, part, sd, bends or straight)
            if ball and part > BESIDE:
                near.append(touch)
            if abs(gap) <= self.cuts.reach * sd and part > 0:
                touches.append(touch)
        if ball:
            sd = np.sqrt(C[0, 0] if self._isotropic(j) else np.trace(C) / 3)
            touches += over_edges(p, radius, sd, self.convex, self.cuts.reach)
            touches += over_vertices(p, radius, sd, self.vertices, self.cuts.reach)
        return [(t.face, self._log_touch(j, t, C, R) + log_outside(t, near, self.body.diagonal)) for t in touches]

    def _log_touch(self, j, t, C, R):
        log = norm.logpdf(t.gap / t.sd) - np.log(t.sd) + np.log(max(t.share, 1e-300))
        log += self._aimed(t.normal, R.T @ self.q.directions[j], R.T @ self.q.sides[j])
        return log + self._tilted(j, t.normal, R.T @ self.q.normals[j], C, t.bends)

    def _sagitta(self):
        """Return the distance between facets and the round faces that they approximate."""
        off = [abs(f.profile.distance(m)[0]) for f in self.flats if f.profile for m in f.middles]
        return max([min(1.1 * d, 0.05 * self.body.diagonal) for d in off], default=0.0)

    def _isotropic(self, j):
        return np.allclose(self.q.covs[j], self.q.covs[j][0, 0] * np.eye(3), rtol=0, atol=1e-9 * self.q.covs[j][0, 0])

    def _share(self, flat, p, C, n, gap):
        """Return the truncated-normal mass in the outline, given the offset along the normal."""
        frame = np.stack([flat.u, flat.v])
        along = frame @ C @ n / (n @ C @ n)
        spread = frame @ C @ frame.T - np.outer(along, along) * (n @ C @ n)
        return share(flat.outline, frame @ (p - flat.origin) - along * gap, spread, self.cuts.seen)

    def _aimed(self, n, d, side):
        """Return the density by direction: uniform over the area for points, by the cosine of incidence for beams."""
        if not d.any():
            return -np.log(self.area) + (np.log(BACK_FACE) if n @ side < -CLEARLY else 0.0)
        return np.log(max(-n @ d, GRAZING) if n @ d < 0 else BACK_FACE)

    def _tilted(self, j, n, m, C, bends):
        """Return the density of a sensed normal: two tilts with the variances of sensor and surface."""
        if not m.any():
            return 0.0
        log = np.log(BLOCKED) if n @ m <= 0 else 0.0
        for bend, e in bends:
            log += norm.logpdf(e @ m, scale=np.sqrt(self.q.normal_sds[j] ** 2 + bend**2 * (e @ C @ e)))
        return log

    def on_edges(self, j, p, C, R):
        """Return the density at edges: normal across a straight edge, uniform along it."""
        hits = []
        for k, (a, b) in enumerate(self.body.edges.reshape(-1, 2, 3)):
            d = (b - a) / self.lengths[k]
            frame = np.stack([any_across(d), np.cross(d, any_across(d))])
            x, S = frame @ (p - a), frame @ C @ frame.T
            q, sd, t = x @ np.linalg.solve(S, x), np.sqrt(d @ C @ d), d @ (p - a)
            along = norm.cdf(t / sd) - norm.cdf((t - self.lengths[k]) / sd)
            if q <= self.cuts.reach**2 and along > 0:
                log = -0.5 * q - np.log(2 * np.pi) - 0.5 * np.log(np.linalg.det(S)) + np.log(along / self.lengths.sum())
                hits.append((-2 - k, log))
        return hits

    def on_corners(self, j, p, C, R):
        """Return the density at corners: normal about each corner, equal in all directions."""
        hits, count = [], len(self.body.corners)
        for k, c in enumerate(self.body.corners):
            q = (p - c) @ np.linalg.solve(C, p - c)
            if q <= self.cuts.reach**2:
                log = -0.5 * q - 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(C)[1] - np.log(count)
                hits.append((-2 - len(self.lengths) - k, log))
        return hits

    def on_axes(self, j, p, C, R):
        """Return the density of a circle's centre: normal across the axis, at any height; its radius, side and axis.

        That of a sphere, or an apex, is normal about a point; an apex is named by the one end of its axis.
        """
        hits, (radius, sd, hole), m = [], self.q.circles[j], R.T @ self.q.normals[j]
        first, line = -2 - len(self.lengths) - len(self.body.corners), self.q.kinds[j] == 3
        for *ends, least, most, weight, side, number, kind in self.body.axes:
            if kind != self.q.kinds[j]:
                continue
            a, b = np.array(ends).reshape(2, 3)
            a, b = (end + self.q.radii[j] * (b - a) / np.linalg.norm(b - a) for end in (a, b))  # beside an apex
            d = (b - a) / np.linalg.norm(b - a)
            frame = np.stack([any_across(d), np.cross(d, any_across(d))])
            x, S = frame @ (p - a), frame @ C @ frame.T
            q = x @ np.linalg.solve(S, x)
            off = radius - np.clip(radius, least, most)
            outside = line and q > self.cuts.reach**2
            if outside or hole * side < 0 or (radius and abs(off) >= self.cuts.reach * sd):
                continue
            if line:
                log = -0.5 * q - np.log(2 * np.pi) - 0.5 * np.log(np.linalg.det(S)) + np.log(weight)
            elif (q := (p - a) @ np.linalg.solve(C, p - a)) <= self.cuts.reach**2:
                log = -0.5 * q - 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(C)[1] + np.log(weight)
            else:
                continue
            log += norm.logpdf(off, scale=sd) if radius else 0.0
            log += np.log(2.0) if hole else 0.0
            if m.any():  # half of the axes are named by their other end
                tilts = frame @ m
                log += norm.logpdf(tilts, scale=self.q.normal_sds[j]).sum() + (np.log(0.5) if line else 0.0)
                log += np.log(BLOCKED) if not line and d @ m <= 0 else 0.0
            hits.append((first - int(number), log))
        return hits

    def blocked(self, j, p, d, C):
        """Return whether all of five rays along the free-space ray before a hit reach the part early."""
        if not (self.q.free_reach[j] > 0 and d.any()):
            return False
        sd = np.sqrt(d @ C @ d)
        free = self.q.free_reach[j] - IN_FRONT * sd - 0.01 * self.body.diagonal
        u = any_across(d)
        v = np.cross(d, u)
        starts = [p - self.q.free_reach[j] * d + IN_FRONT * sd * sideways for sideways in (0 * u, u, v, -u, -v)]
        return free > 0 and all(cast(self.body, s, d)[0] <= free for s in starts)

    def _log_at_rate(self, hits, rate):
        """Return the log density of all points at a rate of outliers; points of one label share a face."""
        groups, alone = self.q.groups, self.q.groups < 0
        density = np.array([sum(w for _, w in h) for h in hits])
        log = np.log((1 - rate) * density[alone] + rate + self.q.furniture[alone]).sum()
        for g in range(groups.max(initial=-1) + 1):
            rows = np.flatnonzero(groups == g)
            log += self._log_group([hits[j] for j in rows], rows, density[rows], self.q.mean_rate)
        return log

    def _log_group(self, hits, rows, density, rate):
        slip, on_furniture = rate, self.q.furniture[rows]
        by_area = any(self.q.kinds[j] == 0 and not self.q.directions[j].any() for j in rows)
        logs = [
            np.log(slip / (1 - slip)) + self.q.elsewhere,
            np.log((1 - rate) * slip * density + rate + on_furniture).sum(),
        ]
        for face in {face for h in hits for face, _ in h}:
            portion = self._portion(face)
            log = np.log(portion) if face < 0 or by_area else 0.0
            for j, h, d, there in zip(rows, hits, density, on_furniture, strict=True):
                share = portion if face < 0 or (self.q.kinds[j] == 0 and not self.q.directions[j].any()) else 1.0
                on = sum(w for f, w in h if f == face) / share
                log += np.log((1 - rate) * ((1 - slip) * on + slip * d) + rate + there)
            logs.append(log)
        return np.log1p(-slip) + np.logaddexp.reduce(logs)

    def _portion(self, face):
        """Return the prior of a face by its area, of an edge by its length, of a corner by their number."""
        if face >= 0:
            return sum(f.area for f in self.flats if f.face == face) / self.area
        k = -2 - face
        return self.lengths[k] / self.lengths.sum() if k < len(self.lengths) else 1 / len(self.body.corners)

    def log_rays(self, T, z):
        """Return the log likelihood of free paths: half of a cone by its middle ray, an eighth by each of four rays."""
        q, log, rate = self.q, 0.0, self.q.mean_rate
        D = q.shared_jacobian.shape[2]
        for k, (*od, length, slope, least_cosine) in enumerate(q.rays):
            origin, direction = np.array(od[:3]) + q.ray_shifts[k] @ z[:D], np.array(od[3:]) + q.ray_turns[k] @ z[:D]
            o, d = T[:3, :3].T @ (origin - T[:3, 3]), T[:3, :3].T @ direction / np.linalg.norm(direction)
            end = length - 0.01 * self.body.diagonal
            u = any_across(d)
            v = np.cross(d, u)
            passed = float(self._passes(o, d, end, least_cosine))
            if not passed and slope > 0:
                for sideways in (u, v, -u, -v):
                    e = d + 2 * slope * sideways
                    passed += 0.125 * self._passes(o, e / np.linalg.norm(e), end, least_cosine)
            log += np.log(rate + (1 - 2 * rate) * passed)
        return log

    def _passes(self, o, d, end, least_cosine):
        distance, triangle = cast(self.body, o, d)
        if distance >= end:
            return True
        n = self.body.across[triangle]
        return abs(n @ d) / np.linalg.norm(n) < least_cosine - 1e-12

    def log_prior(self, T, z):
        """Return the log prior: unit normal states, the noise scale, a mixture of normal poses, a table."""
        q, D = self.q, self.q.shared_jacobian.shape[2]
        log = -0.5 * z[:D] @ z[:D]
        if q.scale_sd > 0:
            log -= z[D] ** 4 / 16 + np.log(quad(lambda x: np.exp(-(x**4) / 16), -9, 9)[0] / np.sqrt(2 * np.pi))
        if len(q.prior_means):
            logs = []
            for M, root, weight in zip(q.prior_means, q.prior_roots, q.prior_log_weights, strict=True):
                X = np.real(logm(np.linalg.solve(M, T)))
                xi = np.r_[X[:3, 3], X[2, 1], X[0, 2], X[1, 0]]
                logs.append(weight - 0.5 * np.sum((root @ xi) ** 2))
            log += np.logaddexp.reduce(logs)
        if len(q.table):
            world = self.body.vertices @ T[:3, :3].T + T[:3, 3]
            log -= 0.5 * (((world - q.table[:3]) @ q.table[3:6]).min() / q.table[6]) ** 2
        return log


__all__ = ["EXACT", "Cuts", "Flat", "Oracle"]
