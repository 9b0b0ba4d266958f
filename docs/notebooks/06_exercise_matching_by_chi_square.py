r"""
Exercise 2: matching by chi-square
==================================

Two sensed planes have a distance and an angle. Which pair of faces of a model may they be? The test compares the
squared difference over its variance with a chi-square limit: a pair is accepted below it.

Run it from the repository: ``python docs/notebooks/06_exercise_matching_by_chi_square.py``.
"""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import chi2

rng = np.random.default_rng(6)
THICKNESS = {"web": 0.0100, "flange": 0.0115, "rib": 0.0130, "base": 0.0250}
SD = 2e-4

# %%
# Question 1: the limit
# ---------------------
#
# A distance of two parallel faces is the difference of two heights, each with a standard deviation of 0.2 mm. A caliper
# of this kind reads 10.7 mm. Which walls (10.0, 11.5, 13.0 and 25.0 mm) does a test at 5 % accept?
#
# *Solution.* The variance of a difference of independent heights is their sum. The limit of one degree of freedom at 5
# %
# is 3.84, that is 1.96 standard deviations, or 0.55 mm. No wall is accepted; at 0.1 % two are.

variance = 2 * SD**2
for level in (0.05, 0.001):
    limit = chi2.ppf(1 - level, 1)
    accepted = [name for name, size in THICKNESS.items() if (0.0107 - size) ** 2 / variance <= limit]
    print(f"level {level}: limit {limit:.2f}, accepted {accepted}")

# %%
# Question 2: errors of both kinds
# --------------------------------
#
# How often is the right wall rejected, and how often is the flange accepted when the web is sensed? Draw both over the
# level of the test. Which level would you choose?
#
# *Solution.* The right wall is rejected with the level itself. The wrong wall is accepted with the probability that a
# noncentral chi-square variable is below the limit; samples give the same.

levels = np.geomspace(1e-4, 0.3, 30)
limits = chi2.ppf(1 - levels, 1)
reading = THICKNESS["web"] + np.sqrt(variance) * rng.normal(size=100_000)
D2 = {name: (reading - size) ** 2 / variance for name, size in THICKNESS.items()}
lost = np.array([np.mean(D2["web"] > limit) for limit in limits])
wrong = np.array([np.mean(D2["flange"] <= limit) for limit in limits])
at = int(np.argmin(np.abs(levels - 0.05)))
print(f"at 5 %: right wall rejected {lost[at]:.3f}, flange accepted {wrong[at]:.5f}")

# %%
# Question 3: one error for both readings
# ---------------------------------------
#
# The heights were taken with one probe whose ball is 0.3 mm larger than stated (1 sd). On a step the error cancels; on
# a wall touched from both sides it counts twice. What is the variance in each case, and what happens to the test if you
# add the ball's error to each height as if it were independent?
#
# *Solution.* On a step the variance stays :math:`2\sigma^2`; on a wall it is :math:`2\sigma^2 + (2 b)^2`. As if
# independent, it would be :math:`2\sigma^2 + 2 b^2` in both cases: too large on the step, too small on the wall.

BALL = 3e-4
n = 100_000
noise, ball = SD * rng.normal(size=(n, 2)), BALL * rng.normal(size=n)
errors = {"step": noise[:, 0] - noise[:, 1], "wall": noise[:, 0] + noise[:, 1] + 2 * ball}
right = {"step": variance, "wall": variance + 4 * BALL**2}
for name, error in errors.items():
    rates = [np.mean(error**2 / v > chi2.ppf(0.95, 1)) for v in (right[name], variance + 2 * BALL**2)]
    print(f"{name}: rejected at 5 %: {rates[0]:.3f} with the shared error, {rates[1]:.3f} as if independent")

# %%
# Question 4: all pairs at once
# -----------------------------
#
# Six distances of four parallel faces are computed from four heights. Are six tests at 5 % a test at 5 %? Use the joint
# test instead.
#
# *Solution.* The six distances have only three degrees of freedom, and are correlated. The joint statistic
# :math:`e^\top V^{+} e` with the pseudo-inverse is chi-square with three degrees of freedom.

pairs = list(combinations(range(4), 2))
D = np.array([np.eye(4)[b] - np.eye(4)[a] for a, b in pairs])
heights = SD * rng.normal(size=(20000, 4))
e, V = heights @ D.T, SD**2 * D @ D.T
each = np.any(e**2 / np.diag(V) > chi2.ppf(0.95, 1), axis=1).mean()
joint = np.mean(np.sum(e @ np.linalg.pinv(V) * e, axis=1) > chi2.ppf(0.95, 3))
print(f"rejected: six tests {each:.3f}, joint test {joint:.3f}")

figure, axes = plt.subplots(figsize=(6, 3.6))
axes.loglog(levels, lost, color="#0072b2", label="right wall rejected")
axes.loglog(levels, np.maximum(wrong, 1e-5), color="#b84800", label="flange accepted")
axes.set(xlabel="level of the test", ylabel="probability")
axes.legend()
figure.tight_layout()
