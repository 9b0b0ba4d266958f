"""Round features against simulation and a plane's time: ``python benchmarks/round_features.py [trials] [seed]``.

Fits: twelve touches with 0.01 mm an axis on features of 10 mm radius (a cone of 25 degrees), their directions known,
over arcs of 30 to 360 degrees; two to eight touches of a bore and its face. Constraints: all pairs of a scene.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import sys
from pathlib import Path

import numpy as np
from common import Table, seconds
from scipy import special
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from round_scenes import (
    RADIUS,
    constraint_nees,
    error_of,
    nees,
    random_frame,
    round_points,
    size_of,
    whole_covariance,
)
from tanteo.features import Feature, SharedError
from tanteo.features.kinds import KINDS, PLANE
from tanteo.fitting import circle_on_plane, fit_plane, fit_round, observable, round_ml
from tanteo.geometry import SE3, SO3

KIND_NAMES, ARCS, POINTS, SD = ("circle", "cylinder", "cone", "sphere"), (360, 180, 120, 90, 60, 45, 30), 12, 1e-5
CHUNK, SHARED_SD = 500, 1e-5


def interval(dof, count):
    """Return the 95 % interval of the mean of ``count`` chi-square values over their degrees of freedom."""
    low, high = special.chdtri(dof * count, [0.975, 0.025]) / (dof * count)
    return f"{low:.3f} to {high:.3f}"


def simulated(kind, arc, trials, rng):
    """Touches of one feature ``(trials, n, 3)``, its frame, and covariances and directions of all."""
    T, (q, away) = random_frame(rng), round_points(kind, arc, POINTS)
    points = SE3.apply(T, q) + SD * rng.normal(size=(trials, POINTS, 3))
    return T, points, np.tile(SD**2 * np.eye(3), (POINTS, 1, 1)), away @ T[:3, :3].T


def fit_rows(kind, arc, trials, rng, plane_time):
    T, points, covs, away = simulated(kind, arc, trials, rng)
    values, chi2, refused = [], [], 0
    for part in np.array_split(points, max(1, trials // CHUNK)):
        outward = None if kind == "circle" else np.broadcast_to(away, part.shape)
        found = round_ml(KINDS[kind], part, covs, outward=outward)
        ok = observable(KINDS[kind], found, part)
        refused += int((~ok).sum())
        error = error_of(kind, found.fit.T, T, found.size, size_of(kind))
        values.append(nees(error, found.fit.P)[ok])
        chi2.append(found.fit.chi2[ok])
    accepted, size = np.concatenate(values), KINDS[kind].size + 1
    share, chi2 = refused / trials, np.concatenate(chi2)
    if len(accepted) < 0.5 * trials:
        return (kind, str(arc), f"{100 * share:.1f} %", "-", "-", "-", "-")
    sides = {} if kind == "circle" else {"directions": -away}

    good = next(k for k, value in enumerate(ok) if value)
    time = seconds(lambda: fit_round(KINDS[kind], part[good], covs, **sides), repeats=5)
    return (
        kind, str(arc), f"{100 * share:.1f} %", f"{accepted.mean() / size:.3f}", interval(size, len(accepted)),
        f"{chi2.mean() / found.fit.dof:.3f}", f"{1e3 * time:.2f} ms, {time / plane_time:.1f} x",
    )  # fmt: skip


def table_of_fits(trials, seed):
    rng = np.random.default_rng(seed)
    covs = np.tile(SD**2 * np.eye(3), (POINTS, 1, 1))
    flat = np.c_[rng.uniform(-0.01, 0.01, (POINTS, 2)), SD * rng.normal(size=POINTS)]
    plane_time = seconds(lambda: fit_plane(flat, covs, outward=[0, 0, 1]), repeats=5)
    text = (
        f"{trials} trials a row, 12 touches. NEES over its dimension (frame and size), with the 95 % interval of its "
        f"mean; refused are fits that are not observable. A plane of 12 points takes {1e3 * plane_time:.2f} ms."
    )
    columns = ("kind", "arc deg", "refused", "NEES / dim", "interval", "chi2 / dof", "time, of a plane's")
    rows = [fit_rows(kind, arc, trials, rng, plane_time) for kind in KIND_NAMES for arc in ARCS]
    return Table("Round features", text, columns, rows)


def bore_row(n, known, trials, rng):
    """Touches of a bore with a ball of 1 mm, 5 mm below a face that is known to 5 um and 0.3 and 0.2 mrad."""
    tip, L, values = 1e-3, np.diag([5e-6, 3e-4, 2e-4]), []
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False) if n > 2 else np.array([0.2, 1.9])
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    covs = np.tile(SD**2 * np.eye(3), (n, 1, 1))
    for _ in range(trials):
        T = random_frame(rng)
        at = T @ SE3.from_parts(np.eye(3), np.array([0.03, 0.02, 0.0]))
        points = SE3.apply(at, (RADIUS - tip) * away - np.array([0, 0, 5e-3])) + SD * rng.normal(size=(n, 3))
        face = Feature(PLANE, T @ SE3.exp(-PLANE.B.T @ L @ rng.normal(size=3)), L @ L, "top")
        rim, _ = circle_on_plane(
            points, covs, face, size=known, tip_radius=tip, directions=away @ T[:3, :3].T, convex=False
        )
        error = error_of("circle", rim.T_world_feature, at, rim.radius, RADIUS)
        values.append(nees(error, rim.full_covariance) if known is None else nees(error[:-1], rim.P))
    size = 6 if known is None else 5
    of = "" if known is None else ", radius given"
    return (f"{n} touches{of}", f"{np.mean(values) / size:.3f}", interval(size, trials))


def table_of_bores(trials, seed):
    rng = np.random.default_rng(seed)
    rows = [bore_row(n, known, trials, rng) for n, known in ((3, None), (4, None), (8, None), (2, RADIUS))]
    text = f"{trials} trials a row: the rim of a bore from touches of its wall and its face."
    return Table("Bores on a face", text, ("touches", "NEES / dim", "interval"), rows)


def turned_tip(rng, away):
    """Return an offset of the tip in the frame of the hand, which rotates between touches."""
    return SharedError("tip offset", SHARED_SD**2 * np.eye(3)), SO3.exp(0.7 * rng.normal(size=(len(away), 3)))


def larger_ball(rng, away):
    """Return the error of a ball that is larger than stated, on bosses."""
    return SharedError("tip radius", np.array([[SHARED_SD**2]])), -away[..., None]


def shared_row(kind, what, make, known, trials, rng):
    values, errors = [], {True: [], False: []}
    sd, covs = SHARED_SD / 5, np.tile((SHARED_SD / 5) ** 2 * np.eye(3), (16, 1, 1))
    for _ in range(trials):
        T, (q, away) = random_frame(rng), round_points(kind, 200, 16)
        away = away @ T[:3, :3].T
        error, J = make(rng, away)
        points = SE3.apply(T, q) + sd * rng.normal(size=(16, 3)) - J @ (SHARED_SD * rng.normal(size=J.shape[-1]))
        given = {} if kind == "circle" else {"directions": -away}
        given |= {"size": size_of(kind)} if known else {}
        for stated in (True, False):
            shared = [(error, J)] if stated else []
            f, _ = fit_round(KINDS[kind], points, covs, shared=shared, **given)
            e, last = error_of(kind, f.T_world_feature, T, f.size.value, size_of(kind)), -1 if known else None
            errors[stated].append(e[:last])
            if stated:
                values.append(nees(e[:last], whole_covariance(f)[:last, :last]))
    size = len(errors[True][0])
    places = [1e6 * np.sqrt(np.mean(np.array(errors[stated])[:, :2] ** 2)) for stated in (True, False)]
    return (
        kind, what, f"{np.mean(values) / size:.3f}", interval(size, trials),
        f"{places[0]:.1f} um", f"{places[1]:.1f} um",
    )  # fmt: skip


def table_of_shared(trials, seed):
    rng = np.random.default_rng(seed)
    rows = [shared_row(kind, "tip offset, hand turned", turned_tip, False, trials, rng) for kind in KIND_NAMES]
    rows += [
        shared_row(kind, "tip radius, size given", larger_ball, True, trials, rng) for kind in ("cylinder", "sphere")
    ]
    text = (
        f"{trials} trials a row, 16 touches over 200 degrees, 2 um an axis, and an error of 10 um that all share; "
        "how far the centre (apex, axis) is off, along an axis, and how far if the error is not stated."
    )
    return Table(
        "Errors that touches share", text, ("kind", "error", "NEES / dim", "interval", "off", "not stated"), rows
    )


def table_of_constraints(trials, seed):
    found, dof = constraint_nees(trials, seed)
    rows = []
    for name in sorted({kind for kind, _ in found}):
        keys = [key for key in found if key[0] == name]
        d = dof[keys[0]]
        means = [found[key].mean() / d for key in keys]
        rejected = np.mean([np.mean(found[key] > special.chdtri(d, 0.05)) for key in keys])
        rows.append(
            (name, str(d), str(len(keys)), f"{np.mean(means):.3f}", f"{min(means):.3f} to {max(means):.3f}",
             interval(d, trials), f"{100 * rejected:.1f} %")
        )  # fmt: skip
    columns = (
        "constraint",
        "dof",
        "pairs",
        "NEES / dof",
        "least and greatest pair",
        "interval of one",
        "5 % gate rejects",
    )
    return Table("Constraints of axes and centres", f"{trials} trials of one scene of 13 features.", columns, rows)


def table_of_solvers(trials, seed):
    """Compare with another solver on the same residuals."""
    rng, rows = np.random.default_rng(seed), []
    for kind in KIND_NAMES:
        T, points, covs, _ = simulated(kind, 200, trials, rng)
        kept = list(KINDS[kind].rows)
        ours = round_ml(KINDS[kind], points, covs)
        worst = 0.0
        for k in range(trials):
            other = least_squares(
                residuals_of,
                np.zeros(len(kept) + 1),
                args=(kind, kept, T, points[k]),
                xtol=1e-15,
                ftol=1e-15,
                gtol=1e-15,
            )
            size = size_of(kind) * (1 + other.x[-1])
            worst = max(worst, abs(size - ours.size[k]) / np.sqrt(ours.fit.P[k, -1, -1]))
        rows.append((kind, f"{worst:.1g}"))
    text = f"{trials} fits of 200 degrees: largest difference of the sizes, in their standard deviations."
    return Table("Against scipy.optimize.least_squares", text, ("kind", "difference"), rows)


def residuals_of(x, kind, kept, T, points):
    """Distances in standard deviations, the mean effect of the curvature taken off."""
    xi = np.zeros(6)
    xi[kept] = x[:-1] * np.where(np.array(kept) < 3, 1e-3, 1e-1)
    p, s = SE3.apply(SE3.inverse(T @ SE3.exp(xi)), points), size_of(kind) * (1 + x[-1])
    rho = np.hypot(p[:, 0], p[:, 1])
    if kind == "sphere":
        d = np.linalg.norm(p, axis=1)
        return (d - s - SD**2 / d) / SD
    if kind == "cone":
        return (rho * np.cos(s) - p[:, 2] * np.sin(s) - 0.5 * np.cos(s) * SD**2 / rho) / SD
    off = (rho - s - 0.5 * SD**2 / rho) / SD
    return np.r_[p[:, 2] / SD, off] if kind == "circle" else off


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    trials, seed = (*given, *(2000, 1)[len(given) :])
    for one in (
        table_of_fits(trials, seed), table_of_bores(trials, seed), table_of_shared(trials, seed),
        table_of_constraints(trials, seed), table_of_solvers(min(trials, 50), seed),
    ):  # fmt: skip
        print(one.markdown(), end="\n\n", flush=True)
