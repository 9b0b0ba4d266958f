r"""
Exercise 1: perturbations of frames
===================================

For a class: four exercises on uncertain geometry, each with a solution that runs. Try each question before you read its
solution. You need linear algebra, and the exponential of a rotation.

An uncertain frame is a pose :math:`T` with a small error in its own axes, :math:`T \exp(\xi)`,
:math:`\xi = [v, w] \sim N(0, P)`: translation first, then rotation.

Run it from the repository: ``python docs/notebooks/05_exercise_uncertain_frames.py``.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import chi2

from tanteo.geometry import SE3, SO3, UncertainFrame, compose

rng = np.random.default_rng(5)

# %%
# Question 1: the lever arm
# -------------------------
#
# A robot's hand is known to 0.2 mm and 1 mrad in each axis. A sensor sits 200 mm from it along x. What are the standard
# deviations of the sensor's position? Derive the Jacobian first: how does a rotation of the hand move a point at
# :math:`a`?
#
# *Solution.* :math:`T \exp(\xi)` moves the point :math:`a` by :math:`v + w \times a`. Across the arm, 1 mrad times 200
# mm
# adds 0.2 mm in quadrature; along the arm it adds nothing.

hand = UncertainFrame(np.eye(4), np.diag(np.repeat([2e-4, 1e-3], 3) ** 2))
arm = np.array([0.2, 0.0, 0.0])
J = np.hstack([np.eye(3), -SO3.hat(arm)])
by_hand = np.sqrt(np.diag(J @ hand.C @ J.T))
print("position of the sensor, sd in x, y, z [mm]:", np.round(1e3 * by_hand, 3))

# %%
# Question 2: compose
# -------------------
#
# Show that :math:`T_1 \exp(\xi_1) T_2 = T_1 T_2 \exp(\mathrm{Ad}_{T_2}^{-1} \xi_1)`, and compute the covariance of the
# composition of two uncertain frames. Compare it with :func:`tanteo.geometry.compose`, and with 20,000 samples.
#
# *Solution.* :math:`P = \mathrm{Ad}_{T_2}^{-1} P_1 \mathrm{Ad}_{T_2}^{-T} + P_2`.

mount = UncertainFrame(
    SE3.from_parts(SO3.exp(np.array([0.0, 0.5, 0.3])), arm), np.diag(np.repeat([1e-4, 2e-3], 3) ** 2)
)
A = SE3.adjoint(SE3.inverse(mount.T))
P = A @ hand.C @ A.T + mount.C
draws = [f.T @ SE3.exp(rng.normal(size=(20000, 6)) @ np.linalg.cholesky(f.C).T) for f in (hand, mount)]
xi = SE3.log(SE3.inverse(hand.T @ mount.T) @ draws[0] @ draws[1])
sampled = np.cov(xi.T)
print("largest difference from compose:", f"{np.abs(P - compose(hand, mount).C).max():.1e}")
print("sd by the formula:", np.round(1e3 * np.sqrt(np.diag(P)), 3))
print("sd by samples:    ", np.round(1e3 * np.sqrt(np.diag(sampled)), 3))

# %%
# Question 3: is the region right?
# --------------------------------
#
# The squared Mahalanobis distance :math:`\xi^\top P^{-1} \xi` of the samples should be chi-square with six degrees of
# freedom. Count the samples in the 95 % region. Then multiply all rotations by 100: what happens, and why?
#
# *Solution.* With milliradians 95 % are inside. With 0.1 to 0.2 rad the composition is no longer linear: the second
# order moves the sensor along the arm, which the covariance does not contain.


def inside(scale):
    """Return the fraction of compositions in the 95 % region, with all rotations multiplied by a factor."""
    size = np.repeat([1.0, scale], 3)
    first, second = (f.C * np.outer(size, size) for f in (hand, mount))
    Ts = [f.T @ SE3.exp(rng.normal(size=(20000, 6)) @ np.linalg.cholesky(C).T)
          for f, C in ((hand, first), (mount, second))]  # fmt: skip
    x = SE3.log(SE3.inverse(hand.T @ mount.T) @ Ts[0] @ Ts[1])
    whole = A @ first @ A.T + second
    return float(np.mean(np.sum(x * np.linalg.solve(whole, x.T).T, axis=1) < chi2.ppf(0.95, 6)))


scales = [1, 10, 30, 60, 100]
fractions = [inside(s) for s in scales]
print("inside the 95 % region:", {s: round(f, 3) for s, f in zip(scales, fractions, strict=True)})

figure, axes = plt.subplots(figsize=(6, 3.6))
axes.semilogx(scales, fractions, "o-", color="#0072b2")
axes.axhline(0.95, color="#b84800", ls="--", label="0.95")
axes.set(xlabel="rotations multiplied by", ylabel="fraction in the 95 % region", ylim=(0, 1.02))
axes.legend()
figure.tight_layout()
