"""Points on round features of known size, and how far an estimate is off, for tests and benchmarks."""

from __future__ import annotations

import numpy as np

from tanteo.features import Feature, relate_all
from tanteo.features.kinds import KINDS
from tanteo.geometry import SE3, SO3

RADIUS, HALF_ANGLE = 0.01, np.radians(25.0)


def size_of(kind):
    return HALF_ANGLE if kind == "cone" else RADIUS


def round_points(kind, arc, n):
    """``n`` points over ``arc`` degrees in the feature's frame, and unit vectors away from its axis or centre."""
    k = np.arange(n)
    turn = np.radians(arc) * ((k + 0.5) / n - 0.5)
    e = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    if kind == "circle":
        return RADIUS * e, e
    if kind == "cylinder":  # three rings
        return RADIUS * e + np.c_[0 * turn, 0 * turn, 0.012 * (k % 3 - 1)], e
    if kind == "cone":
        z = 0.015 + 0.01 * (k % 3)
        normal = e * np.cos(HALF_ANGLE) - np.array([0, 0, np.sin(HALF_ANGLE)])
        return z[:, None] * (np.tan(HALF_ANGLE) * e + np.array([0, 0, 1.0])), normal
    lowest = np.cos(np.radians(min(arc, 300.0)) / 2)  # a cap that is so wide; whole balls rest on something
    c, angle = 1 - (1 - lowest) * (k + 0.5) / n, 2.399963 * k
    s = np.sqrt(1 - c * c)
    N = np.c_[s * np.cos(angle), s * np.sin(angle), c]
    return RADIUS * N, N


def random_frame(rng):
    return SE3.exp(np.r_[0.2 * rng.normal(size=3), rng.normal(size=3)])


def error_of(kind, T_hat, T, size_hat, size):
    """``(p, d size)`` of ``T = T_hat exp(B' p) S`` with ``S`` along the symmetries ``(*batch, size + 1)``."""
    gap = SE3.inverse(T_hat) @ T
    if kind in ("circle", "cylinder"):
        over = gap[..., 2, 2] < 0
        gap = np.where(over[..., None, None], gap @ np.diag([1.0, -1.0, -1.0, 1.0]), gap)
    c, u = gap[..., :3, 3], gap[..., :3, 2]
    off = (np.asarray(size) - size_hat)[..., None]
    if kind == "sphere":
        return np.concatenate([c, off], axis=-1)
    across = np.cross(np.array([0.0, 0.0, 1.0]), u)
    sine = np.linalg.norm(across, axis=-1)
    w = across / np.maximum(sine, 1e-300)[..., None] * np.arctan2(sine, u[..., 2])[..., None]
    if kind == "cylinder":
        c = c - u * (c[..., 2:] / u[..., 2:])
    xi = SE3.log(SE3.from_parts(SO3.exp(w), c))
    return np.concatenate([xi[..., list(KINDS[kind].rows)], off], axis=-1)


def nees(error, covariance):
    return np.sum(error * np.linalg.solve(covariance, error[..., None])[..., 0], axis=-1)


def whole_covariance(feature):
    """Return the covariance of frame and size, shared errors included."""
    gains = [np.vstack([term.jacobian, row]) for term, row in zip(feature.shared, feature.size.shared, strict=True)]
    shared = (A @ term.error.covariance @ A.T for A, term in zip(gains, feature.shared, strict=True))
    return sum(shared, feature.full_covariance)


def turned(axis, degrees, at):
    return SE3.from_parts(SO3.axis_rotation(axis, np.radians(degrees)), np.asarray(at, dtype=np.float64))


def related_scene():
    """Features of all kinds at true frames, such that every constraint of axes and centres has a pair ``(kind, T)``."""
    return {
        "plane": ("plane", np.eye(4)),
        "edge": ("edge", turned(2, 20, [0.05, 0.04, 0.0])),
        "slanted edge": ("edge", turned(1, 40, [0.05, -0.06, 0.01])),
        "upright edge": ("edge", turned(1, 90, [-0.05, 0.01, 0.0])),
        "vertex": ("vertex", turned(0, 10, [-0.04, 0.05, 0.02])),
        "hole": ("circle", np.eye(4)),
        "hole 2": ("circle", turned(2, 30, [0.06, 0.02, 0.0])),
        "bore": ("cylinder", turned(2, 50, [0.0, 0.0, -0.02])),
        "cross bore": ("cylinder", turned(1, 90, [0.01, 0.03, 0.03])),
        "slanted bore": ("cylinder", turned(0, 35, [-0.03, -0.02, 0.01])),
        "cone": ("cone", turned(0, -50, [0.02, -0.04, 0.03])),
        "ball": ("sphere", turned(0, 0, [-0.02, 0.06, 0.01])),
        "ball 2": ("sphere", turned(0, 0, [-0.02, 0.06, 0.01])),
    }


def perturbed(name, kind, T, L, rng):
    """Return a feature whose true frame is ``T``, with an error drawn from the covariance ``L L'``."""
    kind = KINDS[kind]
    return Feature(kind, T @ SE3.exp(-kind.B.T @ L @ rng.normal(size=kind.size)), L @ L.T, label=name)


def spread_of(kind, rng, scale=2e-5):
    rows = np.array(KINDS[kind].rows)
    return (
        scale * np.where(rows < 3, 1.0, 20.0)[:, None] * (np.eye(len(rows)) + 0.3 * rng.normal(size=2 * (len(rows),)))
    )


def constraint_nees(trials, seed):
    """NEES of every constraint with an axis, a centre or both: ``(kind, pair) -> values``, and their dof."""
    rng, scene = np.random.default_rng(seed), related_scene()
    roots = {name: spread_of(kind, rng) for name, (kind, _) in scene.items()}
    exact = [
        Feature(KINDS[kind], T, 1e-8 * roots[name] @ roots[name].T, label=name) for name, (kind, T) in scene.items()
    ]
    truth = {(c.kind.name, c.labels): c.value for c in relate_all(exact)}
    found, dof = {}, {}
    for _ in range(trials):
        features = [perturbed(name, kind, T, roots[name], rng) for name, (kind, T) in scene.items()]
        for c in relate_all(features):
            key = (c.kind.name, c.labels)
            if not any(word in c.kind.name for word in ("axis", "coaxial", "cent")) or c.caution:
                continue
            model = 0.0 if c.kind.null else truth.get(key)
            if model is None or (c.kind.null and np.abs(truth.get(key, np.ones(1))).max() > 1e-9):
                continue
            found.setdefault(key, []).append(float(c.distance2(model)))
            dof[key] = c.dof
    return {key: np.array(values) for key, values in found.items() if len(values) > 0.99 * trials}, dof
