r"""
Exercise 3: the posterior of a pose from touches
================================================

A block lies on a table: unknown are x, y and the heading. Touches of its sides determine them, by least squares and by
:func:`tanteo.locate`.

Run it from the repository: ``python docs/notebooks/07_exercise_pose_from_touches.py``.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import chi2

import tanteo
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors
from tanteo.sensors import Readings

rng = np.random.default_rng(7)
LENGTH, WIDTH, HEIGHT, SD = 0.10, 0.06, 0.04, 1e-4
TRUE = np.array([4e-3, -3e-3, np.radians(2.0)])  # x, y [m] and heading [rad] of the corner

# %%
# Three touches
# -------------
#
# Two touches reach the long side (y = 0 in the block's frame), one the short side (x = 0). Each measures the distance
# of a point from a line.

SIDES = np.array([[0.02, 0.0], [0.08, 0.0], [0.0, 0.03]])
NORMALS = np.array([[0.0, -1.0], [0.0, -1.0], [-1.0, 0.0]])


def turned(heading):
    """Return the rotation of the plane by an angle [rad]."""
    return np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])


def touched(count_of_each=1):
    """Return touched points with noise, and the normals of their sides."""
    p, n = np.tile(SIDES, (count_of_each, 1)), np.tile(NORMALS, (count_of_each, 1))
    return p @ turned(TRUE[2]).T + TRUE[:2] + SD * rng.normal(size=p.shape), n


def residuals(state, points, normals):
    """Return the distances of the points from their sides [m]."""
    return np.sum(((points - state[:2]) @ turned(state[2])) * normals, axis=1)


# %%
# Question 1: least squares
# -------------------------
#
# Derive the Jacobian of the residuals over (x, y, heading) and iterate Gauss-Newton from zero. State the covariance.
#
# *Solution.* With :math:`q = R^\top (p - t)` and :math:`r = n^\top q`: the derivative is :math:`-n^\top R^\top` over
# :math:`t`, and :math:`n^\top \dot R^\top (p - t) = n_x q_y - n_y q_x` over the heading.


def jacobian(state, points, normals):
    """Return the derivative of the residuals over x, y and heading."""
    q = (points - state[:2]) @ turned(state[2])
    return np.c_[-normals @ turned(state[2]).T, normals[:, 0] * q[:, 1] - normals[:, 1] * q[:, 0]]


def fit(points, normals):
    """Return the least-squares state and its covariance."""
    state = np.zeros(3)
    for _ in range(10):
        J, r = jacobian(state, points, normals), residuals(state, points, normals)
        state = state - np.linalg.lstsq(J, r, rcond=None)[0]
    return state, SD**2 * np.linalg.inv(J.T @ J)


points, normals = touched()
state, C = fit(points, normals)
print("x, y [mm], heading [deg]:", np.round([*1e3 * state[:2], np.degrees(state[2])], 3))
print("sd:                      ", np.round([*1e3 * np.sqrt(np.diag(C))[:2], np.degrees(np.sqrt(C[2, 2]))], 3))

# %%
# Question 2: why is x worse than y?
# ----------------------------------
#
# Find the principal directions of the covariance of the corner, and explain them.
#
# *Solution.* The single touch of the short side is 30 mm from the corner: an error of the heading moves the corner
# along
# x by 30 mm times that error. In y the corner is outside of the two touches, 20 mm from the nearer one.

values, vectors = np.linalg.eigh(C[:2, :2])
for value, vector in zip(values, vectors.T, strict=True):
    print(f"sd {1e3 * np.sqrt(value):.3f} mm along ({vector[0]:.2f}, {vector[1]:.2f})")

# %%
# Question 3: is the covariance calibrated?
# -----------------------------------------
#
# Repeat the experiment 2,000 times. The mean of the normalized squared error should be 3, and 95 % below the limit.

nees = []
for _ in range(2000):
    found, P = fit(*touched())
    off = found - TRUE
    nees.append(off @ np.linalg.solve(P, off))
print(f"mean {np.mean(nees):.2f}, inside the 95 % region {np.mean(np.array(nees) < chi2.ppf(0.95, 3)):.3f}")

# %%
# Question 4: a face that is not where the CAD has it
# ---------------------------------------------------
#
# Each side of a casting is displaced by 0.2 mm (1 sd). Sixty touches average the noise. Do they average that error? Add
# one state for each side, and compare the standard deviation of y.
#
# *Solution.* A state with prior 0.2 mm for each side keeps the standard deviation of y above 0.2 mm. ``tanteo`` does
# the
# same with ``--form-sd 0.2mm``.

FORM = 2e-4
p, n = touched(20)
J = jacobian(TRUE, p, n)
long_side = (n[:, 1] != 0).astype(float)
G = np.c_[J, long_side, 1 - long_side]
prior = np.diag([0, 0, 0, FORM**-2, FORM**-2])
alone = SD**2 * np.linalg.inv(J.T @ J)
with_faces = np.linalg.inv(G.T @ G / SD**2 + prior)
print(f"sd of y: {1e3 * np.sqrt(alone[1, 1]):.3f} mm without, {1e3 * np.sqrt(with_faces[1, 1]):.3f} mm with the state")

# %%
# Question 5: the same in space
# -----------------------------
#
# Touch five sides of the block, and compare with :func:`tanteo.locate`.

corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * [LENGTH, WIDTH, HEIGHT]
quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
block = tanteo.part_from_mesh(corners, triangles, unit="m", name="block")
at = [(20, 0, 20), (80, 0, 20), (0, 30, 20), (20, 20, 40), (80, 20, 40), (50, 50, 40)]
out = [(0, -1, 0), (0, -1, 0), (-1, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, 1)]
T = SE3.exp(np.array([4e-3, -3e-3, 0, 0, 0, np.radians(2)]))
sensed = SE3.apply(T, np.array(at) / 1e3) + SD * rng.normal(size=(6, 3))
readings = Readings.from_columns(sensed, directions=-np.array(out, dtype=float) @ T[:3, :3].T, sds=np.full(6, SD))
rough = PosePrior(np.eye(4), np.diag(np.repeat([5e-3, 0.05], 3) ** 2))
answer = tanteo.locate(readings, block, priors=Priors(pose=rough))
off = SE3.log(SE3.inverse(answer.best.T_world_part) @ T)
distance = off @ np.linalg.solve(answer.best.covariance, off)
print(f"tanteo: {answer.status}, squared distance {distance:.1f}, expected 6")

figure, axes = plt.subplots(figsize=(5, 4))
angle = np.linspace(0, 2 * np.pi, 100)
ring = (vectors * np.sqrt(values * chi2.ppf(0.95, 2))) @ np.array([np.cos(angle), np.sin(angle)])
axes.plot(*(1e3 * (state[:2, None] + ring)), color="#0072b2", label="95 % region of the corner")
axes.plot(*(1e3 * TRUE[:2]), "x", color="#b84800", label="truth")
axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
axes.legend()
figure.tight_layout()
