"""Random questions for the core: measurements of every kind, shared errors, priors; seeded."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

from tanteo import _core
from tanteo.posterior.outliers import outlier_rates

RADIUS = 0.1
"""Of the workspace [m]."""

WIDTHS = _core.lane_widths()


NAMES = "surface_point", "edge_point", "corner_point", "axis_centre", "surface_point", "sphere_centre", "cone_apex"
"""Kinds of measurements of the oracle, by number; the fifth is on a face that is not flat."""


def per_width(answer):
    """Return the answers with each width; the widest is in use afterwards."""
    try:
        found = []
        for width in WIDTHS:
            _core.set_lane_width(width)
            found.append(answer())
    finally:
        _core.set_lane_width(WIDTHS[-1])
    return found


def fields_before_shared():
    """Return number of fields before the shared errors."""
    return [f.name for f in fields(Question)].index("shared_jacobian")


@dataclass(frozen=True, eq=False)
class Question:
    """Measurements as columns, for all kinds; the oracle reads these."""

    points: np.ndarray
    covs: np.ndarray
    extra: np.ndarray
    radii: np.ndarray
    directions: np.ndarray
    sides: np.ndarray
    normals: np.ndarray
    normal_sds: np.ndarray
    free_reach: np.ndarray
    log_outlier: np.ndarray
    furniture: np.ndarray
    kinds: np.ndarray
    circles: np.ndarray
    groups: np.ndarray
    elsewhere: float  # log density of each group off the part, over that of as many outliers
    shared_jacobian: np.ndarray
    scale_sd: float
    rates: np.ndarray
    rate_weights: np.ndarray
    mean_rate: float
    rays: np.ndarray
    ray_shifts: np.ndarray
    ray_turns: np.ndarray
    prior_means: np.ndarray
    prior_roots: np.ndarray
    prior_log_weights: np.ndarray
    table: np.ndarray
    one_sided: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))

    def core(self, area=0.0, length=0.0):
        """Compiled, with the size of the touched region on faces and edges; every label covers a third of it."""
        blocks = []
        for kind in np.unique(self.kinds):
            rows = np.flatnonzero(self.kinds == kind).astype(np.int32)
            blocks.append((_core.make_factors(NAMES[kind], self._columns(rows, kind)), rows))
        rest = [getattr(self, f.name) for f in fields(self)[fields_before_shared() :]]
        elsewhere = np.full(self.groups.max(initial=-1) + 1, self.elsewhere)
        shared, *others, sides = (np.ascontiguousarray(v) if isinstance(v, np.ndarray) else v for v in rest)
        furniture = np.ascontiguousarray(self.furniture)
        region = np.array([area, length]), np.full(len(elsewhere), area / 3)
        none = np.zeros((0, 3, 0))
        return _core.make_problem(blocks, furniture, self.groups, elsewhere, shared, none, *others, *region, sides)

    def _columns(self, rows, kind):
        """Return the columns of a kind."""
        own = {
            "points": self.points, "covs": self.covs, "extra": self.extra, "log_outlier": self.log_outlier,
            "normals": self.normals, "normal_sds": self.normal_sds,
        }  # fmt: skip
        if NAMES[kind] in ("surface_point", "edge_point", "corner_point"):
            own |= {
                "radii": self.radii, "directions": self.directions, "sides": self.sides, "free_reach": self.free_reach,
                "round_face": np.full(len(self.kinds), float(kind == 4)),
            }  # fmt: skip
        else:
            own |= {"sizes": self.circles[:, 0], "size_sds": self.circles[:, 1], "material_sides": self.circles[:, 2]}
            own |= {"offsets": self.radii}
        alone = len(rows) == len(self.kinds)  # unchanged, also where its shape is wrong
        return {n: np.ascontiguousarray(c if alone else c[rows], dtype=float) for n, c in own.items()}

    @property
    def states(self):
        """Shared errors, and the noise scale."""
        return self.shared_jacobian.shape[2] + (self.scale_sd > 0)

    def taken(self, rows):
        """Return some of the points, in any order."""
        names = [f.name for f in fields(self) if f.name != "elsewhere"][:15]
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


def random_pose(rng, shift=0.1):
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=rng.integers(2**31)).as_matrix()
    T[:3, 3] = rng.uniform(-shift, shift, 3)
    return T


def near_pose(T, rng, shift, turn):
    """Return a pose near another one."""
    out = T.copy()
    out[:3, 3] += shift * rng.normal(size=3)
    out[:3, :3] = T[:3, :3] @ Rotation.from_rotvec(turn * rng.normal(size=3)).as_matrix()
    return out


def touched(body, T, n, sd, rng, *, edgy=0.4, outliers=0.1):
    """Isotropic points of a body, many of them near edges, some of them anywhere; the normals of the faces, too."""
    p, normals = body.surface_points(n, rng)
    near = rng.uniform(size=n) < edgy
    rows = rng.integers(len(body.triangles), size=n)
    a, b = body.vertices[body.triangles[rows][:, :2]].transpose(1, 0, 2)
    at_edge = a + rng.uniform(size=(n, 1)) * (b - a)
    p[near] = at_edge[near] + 2 * sd * rng.normal(size=(near.sum(), 3))
    world = (p + sd * rng.normal(size=p.shape)) @ T[:3, :3].T + T[:3, 3]
    lost = rng.uniform(size=n) < outliers
    world[lost] += 0.02 * rng.normal(size=(lost.sum(), 3))
    return point_question(world, sd), normals @ T[:3, :3].T


def point_question(points, sd, *, rate=0.02):
    """Return a question about points alone, with isotropic noise."""
    n = len(points)
    rates, weights = outlier_rates(rate, n)
    none = np.zeros((0, 3, 0))
    ball = np.log(4 / 3 * np.pi * RADIUS**3)
    return Question(
        points, sd**2 * np.tile(np.eye(3), (n, 1, 1)), np.zeros(n), np.zeros(n), *np.zeros((3, n, 3)),
        np.full(n, np.pi), np.zeros(n), np.full(n, -ball), np.zeros(n), np.zeros(n, np.int32), np.zeros((n, 3)),
        np.full(n, -1, np.int32),
        2.0, np.zeros((n, 3, 0)), 0.0, np.array(rates), np.array(weights), rate, np.zeros((0, 9)), none, none,
        np.zeros((0, 4, 4)), np.zeros((0, 6, 6)), np.zeros(0), np.zeros(0),
    )  # fmt: skip


def anisotropic(q, rng):
    """Noise that differs from direction to direction by up to ten times, and a tolerance."""
    sd = np.sqrt(q.covs[:, 0, 0])
    A = rng.normal(size=q.covs.shape) * rng.uniform(0.3, 1.5, size=(len(sd), 1, 3))
    covs = sd[:, None, None] ** 2 * (A @ np.swapaxes(A, 1, 2) / 3 + 0.05 * np.eye(3))
    return replace(q, covs=covs, extra=(0.3 * sd) ** 2)


def directed(q, normals, rng, *, free_reach=0.0):
    """Return a question with beams from about the outward side of the surface; some from the back."""
    d = -normals + 0.5 * rng.normal(size=normals.shape)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return replace(
        q, directions=d, free_reach=np.full(len(d), free_reach), log_outlier=np.full(len(d), -np.log(2 * RADIUS))
    )


def sided(q, normals, rng):
    """Points of which only the side of the material is known, some of them of the wrong one."""
    return replace(q, sides=np.where(rng.uniform(size=(len(normals), 1)) < 0.1, -1, 1) * normals)


def oriented(q, normals, rng, tilt=0.05):
    """Sensed normals."""
    turns = Rotation.from_rotvec(tilt * rng.normal(size=normals.shape))
    return replace(
        q,
        normals=turns.apply(normals),
        normal_sds=np.full(len(normals), tilt),
        log_outlier=q.log_outlier - np.log(4 * np.pi),
    )


def furnished(q, rng):
    """Return a question where some points may be on furniture and some surely are."""
    return replace(
        q, furniture=np.where(rng.uniform(size=len(q.points)) < 0.5, 0.0, 10 ** rng.uniform(-3, 6, len(q.points)))
    )


def with_shared(q, D, rng, size=1e-3):
    """Errors that the points share, and the rays if there are any."""
    m = len(q.rays)
    return replace(
        q, shared_jacobian=size * rng.normal(size=(len(q.points), 3, D)), ray_shifts=size * rng.normal(size=(m, 3, D)),
        ray_turns=0.01 * rng.normal(size=(m, 3, D)),
    )  # fmt: skip


def with_amounts(q, rng):
    """Two shared errors on one side and one on both."""
    return replace(with_shared(q, 3, rng), one_sided=np.array([1, 0, 1], np.int32))


def with_rays(q, body, T, rng, m=12, slope=0.0):
    """Free rays, half of them through the body."""
    p, _ = body.surface_points(m, rng)
    aim = p @ T[:3, :3].T + T[:3, 3] + 0.02 * rng.normal(size=(m, 3))
    d = rng.normal(size=(m, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    cosines = np.where(rng.uniform(size=m) < 0.5, 0.0, 0.4)
    rays = np.column_stack([aim - 0.2 * d, d, rng.uniform(0.15, 0.4, m), np.full(m, slope), cosines])
    D = q.shared_jacobian.shape[2]
    return replace(q, rays=rays, ray_shifts=np.zeros((m, 3, D)), ray_turns=np.zeros((m, 3, D)))


def with_prior(q, T, rng, count=2, shift=0.01, turn=0.2):
    """Return a question with a mixture of normal densities of the pose, and a table."""
    means = np.stack([near_pose(T, rng, shift, turn) for _ in range(count)])
    A = rng.normal(size=(count, 6, 6)) * np.r_[np.full(3, shift), np.full(3, turn)][:, None]
    covs = A @ np.swapaxes(A, 1, 2) + 0.1 * np.diag(np.r_[np.full(3, shift**2), np.full(3, turn**2)])
    roots = np.swapaxes(np.linalg.cholesky(np.linalg.inv(covs)), 1, 2)
    log = -3 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(covs)[1] + np.log(rng.dirichlet(np.ones(count)))
    normal = rng.normal(size=3)
    table = np.r_[T[:3, 3] + 0.05 * rng.normal(size=3), normal / np.linalg.norm(normal), 0.01]
    return replace(q, prior_means=means, prior_roots=roots, prior_log_weights=log, table=table)
