"""Prior of the pose: a prior pose with covariance, a box, a table."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, check_covariances, check_transforms
from tanteo.geometry.limits import LEAST_SD, NOTABLE, check_length, check_number, check_places, check_spreads
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.values import Value, lock

_INDEPENDENT = 0.1
"""Numerical: smallest singular value of the normals of planes that fix a position together."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Plane on which the part stands or lies, or against which it rests, in the world.

    Attributes:
        point: point on the plane ``(3,)`` [m].
        normal: normal of the plane towards the part ``(3,)``.
        sd: standard deviation of its height [m].
        leaning: probability that the part is in none of its stable poses on this plane: it leans on something, or is
            held.
    """

    point: Vectors
    normal: Vectors
    sd: float
    leaning: float = NOTABLE

    def __post_init__(self) -> None:
        check_number("table, leaning", self.leaning)
        if not 0 < self.leaning <= 1:
            raise InputError(f"table, leaning: expected a probability above 0, got {self.leaning}. 1 is any pose.")
        length = float(np.linalg.norm(self.normal))
        if not (np.isfinite(length) and length > 0):
            raise InputError("plane: expected a normal that is not zero, got (0, 0, 0). Correct it.")
        check_places("table", np.asarray(self.point))
        check_length("table, sd", self.sd, LEAST_SD)
        object.__setattr__(self, "point", np.array(self.point, dtype=np.float64))
        object.__setattr__(self, "normal", np.array(self.normal, dtype=np.float64) / length)

    @property
    def frame(self) -> Transforms:
        """Return the frame of the table in the world ``(4, 4)``; its plane is z = 0."""
        x = np.linalg.svd(self.normal[None])[2][1]
        return SE3.from_parts(np.stack([x, np.cross(self.normal, x), self.normal], axis=1), self.point)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PosePrior(Value):
    """Prior of the pose. Without any entry, place and attitude are uniform in the workspace.

    Attributes:
        T_world_part: prior pose ``(4, 4)``, or one prior pose for each of ``S`` queried poses ``(S, 4, 4)``.
        covariance: covariance of the prior pose ``(6, 6)``, or of each ``(S, 6, 6)``; order x y z rx ry rz, part frame,
            right perturbation [m, rad].
        box: lowest and highest world coordinates of the part's centroid ``(2, 3)`` [m].
        table: table on which the part rests.
        rests: planes of a fixture that the part touches from the side of their normals, such as a fixed jaw, rails, or
            the two faces of a V-block; with the table at most three.
        root: root of the inverse covariance, which whitens residuals ``(6, 6)`` or ``(S, 6, 6)``.

    Raises:
        InputError: a prior pose without its covariance or the reverse, a pose that is not a rigid motion, a box of
            which the lowest corner is not below the highest, or planes that do not fix a position together.

    Example:
        >>> import numpy as np
        >>> T = np.eye(4)
        >>> near = tanteo.PosePrior(T_world_part=T, covariance=np.diag([1e-4] * 3 + [1e-2] * 3))
        >>> tanteo.Priors(pose=near).pose is near
        True
    """

    T_world_part: Transforms | None = None
    covariance: Covariances | None = None
    box: FloatArray | None = None
    table: Table | None = None
    rests: tuple[Table, ...] = ()
    root: FloatArray | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if (self.T_world_part is None) != (self.covariance is None):
            raise InputError("prior: expected a prior pose with its covariance, got one of the two. Give both.")
        if self.covariance is not None:
            C = check_covariances("prior, covariance", self.covariance, 6)
            if np.linalg.eigvalsh(C).min(initial=np.inf) <= 0:
                raise InputError("prior, covariance: expected a positive variance in every direction, got zero.")
            check_spreads("prior, covariance", C)
            Ts = check_transforms("prior, T_world_part", np.asarray(self.T_world_part))
            check_places("prior, T_world_part", Ts[..., :3, 3])
            object.__setattr__(self, "T_world_part", Ts)
            object.__setattr__(self, "covariance", C)
            object.__setattr__(self, "root", np.swapaxes(np.linalg.cholesky(np.linalg.inv(C)), -1, -2))
        if self.box is not None:
            box = np.array(self.box, dtype=np.float64)
            if box.shape != (2, 3) or not np.all(box[1] > box[0]):
                raise InputError(f"prior, box: expected lowest and highest x, y, z, got {box.tolist()}.")
            check_places("prior, box", box)
            object.__setattr__(self, "box", box)
        object.__setattr__(self, "rests", tuple(self.rests))
        normals = np.array([plane.normal for plane in self.planes]).reshape(-1, 3)
        if len(normals) > 3 or np.linalg.svd(normals)[1].min(initial=1.0) < _INDEPENDENT:
            raise InputError(
                "rests: expected at most three planes, the table included, no two parallel and not all along one line, "
                f"got normals {np.round(normals, 4).tolist()}. Of two jaws give the fixed one."
            )
        lock(self)

    @property
    def planes(self) -> tuple[Table, ...]:
        """Return all planes that the part touches: the table first, then those of a fixture."""
        return self.rests if self.table is None else (self.table, *self.rests)


def prior_rows(
    prior: PosePrior | None, part: Part, Ts: Transforms, rows: IntArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return whitened residuals of the prior at poses ``(S, m)`` and their derivatives ``(S, m, 6)``.

    Args:
        prior: prior of the pose.
        part: the part.
        Ts: poses ``(S, 4, 4)``.
        rows: index of the prior pose of each pose ``(S,)``; needed only if the prior has several.
    """
    r, J = [np.zeros((len(Ts), 0))], [np.zeros((len(Ts), 0, 6))]
    if prior is not None and prior.T_world_part is not None:
        e, L = _from_prior_pose(prior, Ts, rows)
        r.append((L @ e[..., None])[..., 0])
        J.append(L @ SE3.right_jacobian_inverse(e))
    for plane in () if prior is None else prior.planes:
        gap, row = _height_over_table(plane, part, Ts)
        r.append(gap[:, None] / plane.sd)
        J.append(row[:, None] / plane.sd)
    return np.concatenate(r, axis=1), np.concatenate(J, axis=1)


def prior_residuals(prior: PosePrior, part: Part, Ts: Transforms) -> FloatArray:
    """Return the residuals of :func:`prior_rows` without derivatives ``(S, m)``."""
    r = [np.zeros((len(Ts), 0))]
    if prior.T_world_part is not None:
        e, L = _from_prior_pose(prior, Ts, None)
        r.append((L @ e[..., None])[..., 0])
    r += [_height_over_table(plane, part, Ts)[0][:, None] / plane.sd for plane in prior.planes]
    return np.concatenate(r, axis=1)


def _from_prior_pose(prior: PosePrior, Ts: Transforms, rows: IntArray | None) -> tuple[FloatArray, FloatArray]:
    """Return the perturbation of each pose from its prior pose ``(S, 6)``, and the root that whitens it."""
    T0, L = prior.T_world_part, prior.root
    assert T0 is not None
    assert L is not None
    if rows is not None and T0.ndim > 2:
        T0, L = T0[rows], L[rows]
    return SE3.log(SE3.inverse(T0) @ Ts), L


def _height_over_table(table: Table, part: Part, Ts: Transforms) -> tuple[FloatArray, FloatArray]:
    """Return the height of the part's lowest point over the table ``(S,)``, and its derivative ``(S, 6)``."""
    n = table.normal @ Ts[:, :3, :3]  # the table's normal in the part
    heights = n @ part.vertices.T
    v = part.vertices[np.argmin(heights, axis=1)]
    gap = heights.min(axis=1) + (Ts[:, :3, 3] - table.point) @ table.normal
    return gap, np.concatenate([n, np.cross(v, n)], axis=1)


def log_density_within(prior: PosePrior | None, radius: float) -> FloatArray:
    """Return the log normalization of the prior of the pose relative to a uniform density.

    The squared residuals of :func:`prior_rows` are not included. The value applies to poses inside the box. It is one
    number, or ``(S,)`` if the prior has ``S`` prior poses.

    Args:
        prior: prior of the pose.
        radius: radius of the workspace [m]; the uniform density covers a cube of side ``2 radius`` and all attitudes.
    """
    log = np.zeros(())
    if prior is None:
        return log
    if prior.covariance is not None:
        log = log + 3 * np.log(2 * radius) + np.log(8 * np.pi**2)
        log = log - 3 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(prior.covariance)[1]
    for plane in prior.planes:
        log = log + np.log(2 * radius) - 0.5 * np.log(2 * np.pi) - np.log(plane.sd)
    if prior.planes:  # heights over oblique planes change together
        normals = np.array([plane.normal for plane in prior.planes])
        log = log + 0.5 * np.linalg.slogdet(normals @ normals.T)[1]
    if prior.box is not None:
        log = log + 3 * np.log(2 * radius) - np.log(np.prod(prior.box[1] - prior.box[0]))
    return np.asarray(log)


def in_box(prior: PosePrior | None, part: Part, Ts: Transforms) -> BoolArray:
    """Return whether each pose puts the part's centroid into the box of the prior ``(S,)``; True without a box."""
    if prior is None or prior.box is None:
        return np.ones(len(Ts), dtype=bool)
    centre = SE3.apply(Ts, part.centroid)
    return np.asarray(np.all((centre >= prior.box[0]) & (centre <= prior.box[1]), axis=1))
