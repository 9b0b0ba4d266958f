"""What each published formula costs, measured: the figures of ``docs/paper.md``.

    python tests/paper/effects.py

Lengths in millimetres. An edge is five points over 40 mm with 0.3 mm of noise; estimates are drawn around the truth
and judged by the package's own functions, published and corrected. Fixed seeds: the same figures everywhere.
"""

from __future__ import annotations

import numpy as np

import tanteo.features as cs
from tanteo import fitting
from tanteo.features.constraints import published
from tanteo.features.kinds import EDGE, PLANE
from tanteo.geometry import SE3, SO3
from tanteo.geometry.location import matrix_to_loc

N = 40_000
EDGE_SD = np.array([0.3 / 5**0.5, 0.3 / 5**0.5, 0.3 / 1000**0.5, 0.3 / 1000**0.5])
PLANE_SD = np.array([0.2, 0.005, 0.005])


def body(kind, sd):
    return kind.B.T @ np.diag(sd**2) @ kind.B


def draw(T, kind, sd, rng, n=N):
    return T @ SE3.exp((rng.normal(size=(n, kind.size)) * sd) @ kind.B)


def edge_at(direction, origin, spin=0.0):
    R = SO3.frame_from_axis(np.asarray(direction, dtype=float), 0) @ SO3.axis_rotation(0, spin)
    return SE3.from_parts(R, np.asarray(origin, dtype=float))


def rejected(D2, dof, significance=0.05):
    return float(np.mean(cs.chi2_limit(significance, dof) < D2))


def coplanarity(psi, slide, seed=0):
    """Return the rate of false rejection of an edge on the plane: printed tests of (5), and the joint test."""
    rng = np.random.default_rng(seed)
    flat = SE3.from_parts(SO3.axis_rotation(2, 0.4) @ SO3.axis_rotation(0, psi), np.zeros(3))
    S = draw(np.eye(4), PLANE, PLANE_SD, rng)
    to_origin = SE3.from_parts(np.eye(3), np.array([slide, 0.0, 0.0]))
    A = EDGE.B @ SE3.adjoint_inverse(to_origin) @ EDGE.B.T
    P = A @ np.diag(EDGE_SD**2) @ A.T
    E, C_E = draw(flat, EDGE, EDGE_SD, rng) @ to_origin, EDGE.B.T @ P @ EDGE.B
    C_S = body(PLANE, PLANE_SD)
    value, printed = published.coplanarity(S, C_S, E, C_E)
    D2 = value**2 / np.diagonal(printed, axis1=-2, axis2=-1)
    both = cs.coplanarity(S, C_S, E, C_E)
    return {
        "printed p_z": rejected(D2[:, 0], 1),
        "printed theta": rejected(D2[:, 1], 1),
        "printed either": float(np.mean(np.any(cs.chi2_limit(0.05) < D2, axis=1))),
        "joint": rejected(cs.chi2_statistic(both.value, both.covariance), 2),
        "sd p_z true": float(value[:, 0].std()),
        "sd p_z printed": float(np.sqrt(printed[:, 0, 0].mean())),
    }


def intersection(spin):
    """Predicted standard deviation of the abscissa at a right corner: (9) and the common perpendicular."""
    E1 = edge_at([0, 1, 0], [0, 20, 0])
    turn = spin - np.arctan2(E1[2, 1], E1[2, 2])  # angle from the common normal to z of the first edge
    E1 = E1 @ SE3.from_parts(SO3.axis_rotation(0, turn), np.zeros(3))
    E2 = edge_at([1, 0, 0], [20, 0, 0])
    C = body(EDGE, EDGE_SD)
    foot = cs.intersect(E1, C, E2, C)
    printed = float(np.sqrt(published.abscissa_z(E1, C, E2, C).variance))
    return {"printed (9)": printed, "corrected": float(np.sqrt(foot.variance))}


def length(corners, sd_edge=1.0, sd_neighbour=1.0, seed=2):
    """NEES of a 40 mm length between corners of those angles: (15), and with the common edge counted once."""
    rng = np.random.default_rng(seed)
    a, b = corners
    # the z axes of the neighbours are turned off the common normal, or (9) is singular
    A = edge_at([np.cos(a), np.sin(a), 0], 20 * np.array([np.cos(a), np.sin(a), 0]), 0.9)
    B = edge_at([-np.cos(b), np.sin(b), 0], np.array([40, 0, 0]) + 20 * np.array([-np.cos(b), np.sin(b), 0]), 1.2)
    E = edge_at([1, 0, 0], [20, 0, 0])
    sds = [sd_neighbour * EDGE_SD, sd_edge * EDGE_SD, sd_neighbour * EDGE_SD]
    Ts = [draw(T, EDGE, sd, rng) for T, sd in zip((A, E, B), sds, strict=True)]
    Cs = [body(EDGE, sd) for sd in sds]
    joint = np.zeros((18, 18))
    for k, C in enumerate(Cs):
        joint[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = C
    each = (Ts[0], Cs[0], Ts[1], Cs[1], Ts[2], Cs[2])
    printed, found = published.edge_length(*each), cs.edge_length(*Ts, joint)
    ends = [cs.intersect(Ts[k], Cs[k], Ts[1], Cs[1]) for k in (0, 2)]
    error = found.value - 40
    D2 = error**2 / (ends[0].variance + ends[1].variance)
    return {
        "median D2 printed (9), (15), 1 if right": float(
            np.median((printed.value - 40) ** 2 / printed.variance) / 0.4549
        ),
        "NEES independent ends": float(np.mean(D2)),
        "NEES corrected": float(np.mean(error**2 / found.variance)),
        "rejected independent ends": rejected(D2, 1),
        "rejected corrected": rejected(error**2 / found.variance, 1),
        "sd": float(error.std()),
    }


def shared_length(seed=3):
    """Return a length of edges that share a robot base error of 0.5 mm and 2 mrad, which each covariance contains."""
    rng = np.random.default_rng(seed)
    Ts = [
        edge_at([0.5, 0.87, 0], [10, 17.4, 0]),
        edge_at([1, 0, 0], [20, 0, 0]),
        edge_at([-0.5, 0.87, 0], [30, 17.4, 0]),
    ]
    base = np.diag([0.5] * 3 + [2e-3] * 3)
    A = np.concatenate([EDGE.B.T @ EDGE.B @ SE3.adjoint_inverse(T) for T in Ts]) @ base
    C = np.kron(np.eye(3), body(EDGE, EDGE_SD)) + A @ A.T
    alone = C * np.kron(np.eye(3), np.ones((6, 6)))
    move = SE3.exp(rng.normal(size=(N, 6)) @ base)
    hats = [move @ draw(T, EDGE, EDGE_SD, rng) for T in Ts]
    found, printed = cs.edge_length(*hats, C), cs.edge_length(*hats, alone)
    truth = cs.edge_length(*Ts, C).value
    D2 = (found.value - truth) ** 2
    return {
        "sd true": float(found.value.std()),
        "sd independent": float(np.sqrt(printed.variance.mean())),
        "sd corrected": float(np.sqrt(found.variance.mean())),
        "NEES independent": float(np.mean(D2 / printed.variance)),
        "NEES corrected": float(np.mean(D2 / found.variance)),
        "rejected independent": rejected(D2 / printed.variance, 1),
    }


def parallelism(tilt_sigmas=0.0, seed=4):
    """Rejection of two edges that are tilted by so many standard deviations: (21) and the two-component test."""
    rng = np.random.default_rng(seed)
    sd = np.array([0.05, 0.05, 0.005, 0.005])
    tilt = tilt_sigmas * 0.005 * 2**0.5
    T2 = SE3.from_parts(SO3.axis_rotation(2, tilt), np.array([0, 30.0, 0]))
    E1, E2, C = draw(np.eye(4), EDGE, sd, rng), draw(T2, EDGE, sd, rng), body(EDGE, sd)
    cosine, _ = published.parallel_edges(E1, C, E2, C)
    both = cs.parallel_edges(E1, C, E2, C)
    return {
        "printed": rejected((cosine.value - 1) ** 2 / cosine.variance, 1),
        "corrected": rejected(cs.chi2_statistic(both.tilt, both.tilt_covariance), 2),
    }


def rayleigh(seed=5):
    """Angle gate (25) on a truly parallel pair, and distance gate on one and the same line."""
    rng = np.random.default_rng(seed)
    sd = np.array([0.05, 0.05, 0.005, 0.005])
    E1, E2, C = draw(np.eye(4), EDGE, sd, rng), draw(np.eye(4), EDGE, sd, rng), body(EDGE, sd)
    angle, (_, distance) = cs.angle_edges(E1, C, E2, C), published.parallel_edges(E1, C, E2, C)
    line = cs.collinearity(E1, C, E2, C)
    return {
        "angle 0": rejected(angle.value**2 / angle.variance, 1),
        "mean angle / sd": float(angle.value.mean() / (0.005 * 2**0.5)),
        "distance 0": rejected(distance.value**2 / distance.variance, 1),
        "collinearity": rejected(cs.chi2_statistic(line.value, line.covariance), 4),
    }


def distance(slide, seed=6):
    """Return the standard deviation of the distance of parallel edges for a distance of the second origin."""
    rng = np.random.default_rng(seed)
    T2 = SE3.from_parts(np.eye(3), np.array([0, 30.0, 0]))
    C = body(EDGE, EDGE_SD)
    to_origin = SE3.from_parts(np.eye(3), np.array([slide, 0.0, 0.0]))
    A = EDGE.B @ SE3.adjoint_inverse(to_origin) @ EDGE.B.T
    C2 = EDGE.B.T @ A @ np.diag(EDGE_SD**2) @ A.T @ EDGE.B
    E1, E2 = draw(np.eye(4), EDGE, EDGE_SD, rng), draw(T2, EDGE, EDGE_SD, rng) @ to_origin
    printed, found = published.parallel_edges(E1, C, E2, C2)[1], cs.parallel_edges(E1, C, E2, C2)
    return {"printed": float(printed.value.std()), "corrected": float(found.distance.std())}


def folded(offset_sigmas, seed=7):
    """Mean error, in standard deviations, of ``|p_z|`` (24) and of the signed offset."""
    rng = np.random.default_rng(seed)
    sd = np.array([0.1, 1e-4, 1e-4])
    T2 = SE3.from_parts(np.eye(3), np.array([0, 0, offset_sigmas * 0.1]))
    S1, S2, C = np.eye(4), draw(T2, PLANE, sd, rng), body(PLANE, sd)
    printed = published.parallel_planes(S1, 0 * C, S2, C)[1]
    found = cs.parallel_planes(S1, 0 * C, S2, C)
    truth = offset_sigmas * 0.1
    return {
        "printed": float((printed.value.mean() - truth) / 0.1),
        "corrected": float((found.joint.value[:, 2].mean() - truth) / 0.1),
    }


def sign_of_26(seed=8):
    """Return the standard deviation of a distance of edges on one base: plus sign of (26), minus, independent."""
    rng = np.random.default_rng(seed)
    Ts = (np.eye(4), SE3.from_parts(np.eye(3), np.array([0, 30.0, 0])))
    base = np.diag([0.5] * 3 + [2e-3] * 3)
    shared_jacobian = [EDGE.B.T @ EDGE.B @ SE3.adjoint_inverse(T) @ base for T in Ts]
    C1, C2 = (body(EDGE, EDGE_SD) + A @ A.T for A in shared_jacobian)
    C12 = shared_jacobian[0] @ shared_jacobian[1].T
    move = SE3.exp(rng.normal(size=(N, 6)) @ base)
    E1, E2 = (move @ draw(T, EDGE, EDGE_SD, rng) for T in Ts)
    found = published.parallel_edges(E1, C1, E2, C2, C12)[1]
    plus, none = (published.parallel_edges(*Ts[:1], C1, Ts[1], C2, X)[1].variance for X in (-C12, None))
    return {
        "true": float(found.value.std()),
        "minus (corrected)": float(np.sqrt(found.variance.mean())),
        "plus (printed)": float(np.sqrt(plus)),
        "no cross term": float(np.sqrt(none)),
    }


def families(n_planes, seed=9, n=8000):
    """Return the tests of all angles of some planes at 5 %: truth and mirror image, against the joint test."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n_planes, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    T = SE3.from_parts(SO3.frame_from_axis(normals, 2), 50 * normals)
    sd = np.array([0.1, 0.004, 0.004])
    hats = [draw(t, PLANE, sd, rng, n) for t in T]
    pairs = [(i, j) for i in range(n_planes) for j in range(i)]
    C = body(PLANE, sd)
    D2 = []
    for i, j in pairs:
        found = cs.angle_planes(hats[i], C, hats[j], C)
        truth = np.arccos(np.clip(normals[i] @ normals[j], -1, 1))
        D2.append((found.value - truth) ** 2 / found.variance)
    worst = np.max(D2, axis=0)
    k = len(pairs)
    joint = {name: directions_test(hats, sign * normals, sd) for name, sign in (("truth", 1.0), ("mirror", -1.0))}
    dof = 2 * n_planes - 3
    # angles of the mirror image equal those of the part: its rejection is the same number
    return {
        "rejected univariate": rejected(worst, 1),
        "rejected Sidak": rejected(worst, 1, cs.sidak(0.05, k)),
        "rejected joint": rejected(joint["truth"], dof),
        "mirror accepted univariate": 1 - rejected(worst, 1),
        "mirror accepted joint": 1 - rejected(joint["mirror"], dof),
    }


def directions_test(hats, model, sd):
    """Joint statistic of sensed normals against model normals with the rotation unknown (three Gauss-Newton steps)."""
    sensed = np.stack([T[:, :3, 2] for T in hats], axis=1)
    R = SO3.align(sensed, np.broadcast_to(model, sensed.shape))  # maps sensed to model, proper rotations only
    out = np.empty(len(R))
    x, y = (SO3.frame_from_axis(model, 2)[:, :, k] for k in (0, 1))
    f = sensed @ np.swapaxes(R, 1, 2)
    for k in range(len(R)):
        rows = np.concatenate([np.sum(x * f[k], axis=1), np.sum(y * f[k], axis=1)])
        H = np.concatenate([np.cross(f[k], x), np.cross(f[k], y)])
        out[k] = cs.joint_test(rows, H, sd[1] ** 2 * np.eye(len(rows))).D2
    return out


def plane_of_scan_lines(points):
    """Largest corner sd of a 40 mm square known from two scan lines: end points only (section 3), and all points."""
    sd, t = 0.3, np.linspace(0, 40, points)
    scan = np.r_[np.c_[t, 0 * t, 0 * t], np.c_[0 * t[1:], t[1:], 0 * t[1:]]]
    q = np.array([[0, 0, 0], [40, 0, 0], [0, 0, 0], [0, 40, 0]], dtype=float)
    C = np.eye(12)
    C[0:3, 6:9] = C[6:9, 0:3] = np.eye(3)
    full, _ = fitting.fit_plane(scan, np.broadcast_to(sd**2 * np.eye(3), (len(scan), 3, 3)), outward=[0, 0, 1])
    ends = fitting.plane_from_two_directions(*q, sd**2 * C, outward=[0, 0, 1])
    corners = np.array([[0, 0, 0], [40, 0, 0], [0, 40, 0], [40, 40, 0]], dtype=float)
    worst = [
        np.sqrt(np.diag(fitting.spread.plane_displacement_covariance(f.T_world_feature, f.P, corners)).max())
        for f in (ends, full)
    ]
    return {"printed": float(worst[0]), "corrected": float(worst[1])}


def gimbal_lock(seed=10):
    """Return standard deviations of psi, theta, phi of (27) at theta = 90 degrees, for 5 mrad of body noise."""
    rng = np.random.default_rng(seed)
    T = SE3.from_parts(SO3.axis_rotation(1, np.pi / 2), np.zeros(3))
    e = np.c_[np.zeros((N, 3)), 0.005 * rng.normal(size=(N, 3))]
    x = matrix_to_loc(T @ SE3.exp(e))
    return {name: float(x[:, k].std()) for name, k in (("psi", 3), ("theta", 4), ("phi", 5))}


def main():
    """Print every figure that ``docs/paper.md`` quotes."""
    show("(3)-(5) false rejection at 5 %", {f"psi {p} deg, origin {s} mm": coplanarity(np.radians(p), s)
                                            for p, s in ((0, 0), (45, 0), (90, 0), (90, 100))})  # fmt: skip
    show("(9), (12) sd of the corner [mm]", {f"psi1 {p} deg": intersection(np.radians(p)) for p in (90, 45, 15, 5)})
    shapes = {
        "rectangle": ((90, 90), 1, 1),
        "parallelogram 60/120": ((60, 120), 1, 1),
        "trapezoid 60/60": ((60, 60), 1, 1),
        "trapezoid 60/60, poor middle edge": ((60, 60), 2, 0.5),
        "parallelogram 60/120, poor middle edge": ((60, 120), 2, 0.5),
    }
    show("(13)-(15) length", {name: length(np.radians(c), e, a) for name, (c, e, a) in shapes.items()})
    show("(15), (26) length with a shared robot base [mm]", {"": shared_length()})
    show("(20)-(23) rejection at 5 %", {f"tilt {k} sigma": parallelism(k) for k in (0, 3, 4)})
    show("(16), section 4.4 at the edge of validity", {"rejection at 5 %": rayleigh()})
    show("section 4.4 sd of the distance [mm]", {f"origin at {s} mm": distance(s) for s in (0, 60, 150)})
    show("(24) mean error [sigma]", {f"offset {k} sigma": folded(k) for k in (0, 1, 2)})
    show(
        "section 3, largest corner sd of a plane [mm]", {f"{m} points a line": plane_of_scan_lines(m) for m in (5, 20)}
    )
    show("(26) sd of a distance [mm]", {"": sign_of_26()})
    show("(27), (28) sd at theta = 90 degrees [rad]", {"5 mrad of noise": gimbal_lock()})
    show("(25) families of angles", {f"{k} planes": families(k) for k in (3, 4, 5)})


def show(title, table):
    """Print one block of figures."""
    print(title)
    for name, row in table.items():
        print(f"  {name:40}", "  ".join(f"{key} {value:.4g}" for key, value in row.items()))


if __name__ == "__main__":
    main()
