"""Draw the figures of ``docs/engine.md`` (matplotlib, extra ``plot``).

``python docs/pictures/make_engine.py [folder]`` shows the formulas of the engine in two dimensions.
``engine_density.svg``: the density of a touch near the corner of a part. ``engine_search.svg``: proposals, maxima and
weighted samples for four touches of a planar part, whose pose is two coordinates and an angle.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize
from scipy.special import erf, logsumexp

HERE = Path(__file__).resolve().parent
BLUE, GREEN, ORANGE, GREY = "#0072b2", "#2dae5b", "#b4690e", "#777777"
CORNERS = np.array([[0, 0], [60, 0], [60, 18], [26, 18], [26, 40], [0, 40]], dtype=float)
"""Outline of the part [mm], counterclockwise."""
OUTLIER_RATE, WORKSPACE = 0.01, 200.0**2
"""Outlier rate, and area of the workspace [mm^2]."""


def edges() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return starts, unit directions, outward normals and lengths of the edges of the part."""
    along = np.roll(CORNERS, -1, axis=0) - CORNERS
    lengths = np.linalg.norm(along, axis=1)
    along = along / lengths[:, None]
    return CORNERS, along, np.stack([along[:, 1], -along[:, 0]], axis=1), lengths


def density(points: np.ndarray, sd: float) -> np.ndarray:
    """Return the density of touches ``(..., 2)``: the noise integrated over the outline, uniform by length.

    Each edge adds a normal density across it, times the truncated-normal mass along it.
    """
    starts, along, normals, lengths = edges()
    away = points[..., None, :] - starts
    d = np.einsum("...ij,ij->...i", away, normals)
    s = np.einsum("...ij,ij->...i", away, along)
    mass = 0.5 * (erf(s / sd / np.sqrt(2)) - erf((s - lengths) / sd / np.sqrt(2)))
    return np.sum(np.exp(-0.5 * (d / sd) ** 2) / (np.sqrt(2 * np.pi) * sd) * mass, axis=-1) / lengths.sum()


def to_part(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points in the part's frame at poses ``(..., 3)``: x, y [mm] and angle [rad]."""
    c, s = np.cos(pose[..., 2, None]), np.sin(pose[..., 2, None])
    x, y = points[:, 0] - pose[..., 0, None], points[:, 1] - pose[..., 1, None]
    return np.stack([c * x + s * y, -s * x + c * y], axis=-1)


def log_density(pose: np.ndarray, points: np.ndarray, sd: float) -> np.ndarray:
    """Return the log likelihood of poses ``(..., 3)``, each touch on the part or an outlier."""
    on = density(to_part(pose, points), sd)
    return np.sum(np.log((1 - OUTLIER_RATE) * on + OUTLIER_RATE / WORKSPACE), axis=-1)


def proposals(points: np.ndarray, rng: np.random.Generator, count: int) -> np.ndarray:
    """Return poses at which pairs of touches coincide with pairs of points of the outline at the same distance."""
    starts, along, _, lengths = edges()
    k = rng.choice(len(lengths), (200_000, 2), p=lengths / lengths.sum())
    places = starts[k] + along[k] * (rng.random(k.shape) * lengths[k])[..., None]
    gap = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
    out = []
    for i, j in ((0, 2), (1, 3), (0, 3)):
        close = places[np.abs(gap - np.linalg.norm(points[j] - points[i])) < 1.0]
        u, v = points[j] - points[i], close[:, 1] - close[:, 0]
        angle = np.arctan2(u[1], u[0]) - np.arctan2(v[:, 1], v[:, 0])
        c, s = np.cos(angle), np.sin(angle)
        middle, part = points[[i, j]].mean(axis=0), close.mean(axis=1)
        x = middle[0] - (c * part[:, 0] - s * part[:, 1])
        y = middle[1] - (s * part[:, 0] + c * part[:, 1])
        out.append(np.stack([x, y, (angle + np.pi) % (2 * np.pi) - np.pi], axis=1)[:count])
    return np.concatenate(out)


def maxima(starts: np.ndarray, points: np.ndarray, sd: float) -> np.ndarray:
    """Return distinct maxima of the log density, reached with noise that shrinks to the stated one."""
    found: list[np.ndarray] = []
    for start in starts:
        pose = start
        for blur in (8.0, 2.0, 1.0):
            pose = minimize(lambda p, b=blur: -log_density(p, points, b * sd), pose, method="Nelder-Mead").x
        pose[2] = (pose[2] + np.pi) % (2 * np.pi) - np.pi
        if all(np.linalg.norm((pose - other) / (1.0, 1.0, 0.03)) > 1 for other in found):
            found.append(pose)
    values = log_density(np.array(found), points, sd)
    return np.array(found)[np.argsort(-values)][np.sort(-values) < 9 - values.max()]


def hessian(pose: np.ndarray, points: np.ndarray, sd: float) -> np.ndarray:
    """Return minus the second derivatives of the log density at a maximum, by differences."""
    steps = np.diag([0.02, 0.02, 0.0004])
    H = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            at = [pose + a * steps[i] + b * steps[j] for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            f = log_density(np.array(at), points, sd)
            H[i, j] = -(f[0] - f[1] - f[2] + f[3]) / (4 * steps[i, i] * steps[j, j])
    values, vectors = np.linalg.eigh((H + H.T) / 2)
    return (vectors * np.maximum(values, 0.02)) @ vectors.T


def draw_density(path: Path) -> None:
    """Draw the density of a touch beside the distance to the nearest face."""
    x, y = np.meshgrid(np.linspace(15, 40, 126), np.linspace(8, 33, 126))
    points = np.stack([x, y], axis=-1)
    starts, along, _, lengths = edges()
    away = points[..., None, :] - starts
    s = np.clip(np.einsum("...ij,ij->...i", away, along), 0, lengths)
    nearest = np.linalg.norm(away - s[..., None] * along, axis=-1).min(axis=-1)
    figure, axes = plt.subplots(1, 2, figsize=(8.6, 3.7), sharey=True)
    images = (np.exp(-0.5 * (nearest / 2.0) ** 2), density(points, 2.0))
    for axis, image, title in zip(
        axes, images, ("distance to the nearest face only", "integral over the faces"), strict=True
    ):
        axis.imshow(image / image.max(), extent=(15, 40, 8, 33), origin="lower", cmap="Blues")
        axis.plot(*CORNERS[[2, 3, 4]].T, color=ORANGE, lw=2)
        axis.set(xlim=(15, 40), ylim=(8, 33), title=title, xlabel="x [mm]", aspect="equal")
    axes[0].set_ylabel("y [mm]")
    axes[0].text(17, 11, "part", color=ORANGE)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def draw_search(path: Path) -> None:
    """Draw the three steps of the search for four touches, and print the probabilities of the maxima."""
    rng, sd, truth = np.random.default_rng(4), 0.5, np.array([10.0, -5.0, 0.35])
    starts, along, _, lengths = edges()
    sides, at = np.array([0, 0, 5, 5]), np.array([0.2, 0.55, 0.4, 0.7])
    touched = starts[sides] + along[sides] * (at * lengths[sides])[:, None]
    c, s = np.cos(truth[2]), np.sin(truth[2])
    points = touched @ np.array([[c, s], [-s, c]]) + truth[:2] + rng.normal(scale=sd, size=(4, 2))
    proposed = proposals(points, rng, 150)
    best = proposed[np.argsort(-log_density(proposed, points, 8 * sd))[:40]]
    tops = maxima(best, points, sd)
    covariances = np.array([np.linalg.inv(hessian(top, points, sd)) for top in tops])
    drawn, owner = [], []
    for k, (top, C) in enumerate(zip(tops, covariances, strict=True)):
        normal = rng.multivariate_normal(np.zeros(3), C, 800)
        drawn.append(top + normal / np.sqrt(rng.chisquare(5, 800) / 5)[:, None])  # Student components
        owner += [k] * 800
    samples, owner = np.concatenate(drawn), np.array(owner)
    terms = []
    for top, C in zip(tops, covariances, strict=True):
        e = samples - top
        q = np.einsum("ij,jk,ik->i", e, np.linalg.inv(C), e)
        terms.append(-4.0 * np.log1p(q / 5) - 0.5 * np.linalg.slogdet(C)[1])
    log_w = log_density(samples, points, sd) - logsumexp(terms, axis=0)
    w = np.exp(log_w - logsumexp(log_w))
    shares = np.array([w[owner == k].sum() for k in range(len(tops))])
    print("maximum  x [mm]  y [mm]  angle [deg]  probability")
    for k, (top, share) in enumerate(zip(tops, shares, strict=True)):
        print(f"{k + 1:7d}  {top[0]:6.2f}  {top[1]:6.2f}  {np.degrees(top[2]):11.2f}  {share:11.3f}")
    figure, axes = plt.subplots(1, 3, figsize=(11, 4))
    shown = [best[:25], tops, samples[rng.choice(len(samples), 60, p=w)]]
    titles = ["1  proposals", f"2  maxima: {len(tops)}", "3  samples by weight"]
    for axis, poses, title, color in zip(axes, shown, titles, (GREY, BLUE, GREEN), strict=True):
        for k, pose in enumerate(poses):
            c, s = np.cos(pose[2]), np.sin(pose[2])
            outline = np.vstack([CORNERS, CORNERS[:1]]) @ np.array([[c, s], [-s, c]]) + pose[:2]
            strength = 0.15 + 0.85 * shares[k] / shares.max() if color == BLUE else 0.25
            axis.plot(*outline.T, color=color, lw=1, alpha=strength)
        axis.plot(*points.T, "o", color=ORANGE, ms=5)
        axis.set(title=title, xlabel="x [mm]", aspect="equal", xlim=(-60, 100), ylim=(-55, 75))
    axes[0].set_ylabel("y [mm]")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    mpl.rcParams["svg.hashsalt"] = "tanteo"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    draw_density(folder / "engine_density.svg")
    draw_search(folder / "engine_search.svg")
