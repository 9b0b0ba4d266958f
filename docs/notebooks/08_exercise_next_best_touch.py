r"""
Exercise 4: the next best touch
===============================

Where should a robot touch next? The touch that is expected to reduce the uncertainty most. For a normal posterior and
a linear reading the expected information has a closed form.

Run it from the repository: ``python docs/notebooks/08_exercise_next_best_touch.py``.
"""

import matplotlib.pyplot as plt
import numpy as np

import tanteo
from tanteo.geometry import SE3
from tanteo.planning import Action, Probe, Sensing, Session, Stop
from tanteo.sensors.error_states import Drift, Form, Scale
from tanteo.sensors.presets import NoiseLaw

rng = np.random.default_rng(8)
SD = 2e-4
EXACT = Scale(1e-6), Drift(1e-6), Form(1e-6)

# %%
# Question 1: information of one reading
# --------------------------------------
#
# The state has covariance :math:`C`, a reading :math:`y = g^\top x + e` has variance :math:`\sigma^2`. Show that the
# entropy decreases by :math:`\frac12 \ln(1 + g^\top C g / \sigma^2)` for any value of the reading.
#
# *Solution.* The posterior covariance is :math:`C - C g g^\top C / (g^\top C g + \sigma^2)`; the determinant lemma
# gives
# the ratio. Check it with numbers:

A = rng.normal(size=(3, 3))
C, g = A @ A.T, rng.normal(size=3)
after = C - np.outer(C @ g, C @ g) / (g @ C @ g + 0.5)
formula = 0.5 * np.log(1 + g @ C @ g / 0.5)
print(f"by determinants {0.5 * np.log(np.linalg.det(C) / np.linalg.det(after)):.4f}, by the formula {formula:.4f} nats")

# %%
# Question 2: which touch?
# ------------------------
#
# The long side of a block (100 mm) has an uncertain offset (2 mm) and angle (20 mrad). One touch was made at its
# middle.
# Where is the best second touch, and where the best one if the goal is the offset of the left end only?
#
# *Solution.* A reading at :math:`s` has :math:`g = (1, s)`. After a touch at the middle the offset there is known, and
# the information grows with the distance from the middle: both ends are equally good for the whole state. For the left
# end, reduce the variance of :math:`(1, -50)`: the touch at that end itself is best.

prior = np.diag([2e-3, 20e-3]) ** 2
s = np.linspace(-0.05, 0.05, 101)


def reduced(C, place):
    """Return the covariance after a touch at a place along the side."""
    g = np.array([1.0, place])
    return C - np.outer(C @ g, C @ g) / (g @ C @ g + SD**2)


first = reduced(prior, 0.0)
whole = [0.5 * np.log(1 + np.array([1, x]) @ first @ np.array([1, x]) / SD**2) for x in s]
end = np.array([1.0, -0.05])
left = [np.sqrt(end @ reduced(first, x) @ end) for x in s]
best_whole, best_left = 1e3 * abs(s[np.argmax(whole)]), 1e3 * s[np.argmin(left)]
print(f"most information at |s| = {best_whole:.0f} mm; left end best from s = {best_left:.0f} mm")

# %%
# Question 3: two hypotheses
# --------------------------
#
# The block is one of two that differ in length: 100 or 104 mm, equally probable. A touch of the far side has a
# predicted range of 0 or 4 mm, each with a standard deviation of s. How much information about the block has it at
# s = 0.2, 2 and 8 mm? Compute the mutual information by sampling.
#
# *Solution.* At most ln 2 = 0.693 nats. It is reached if the predictions do not overlap.


def mutual_information(gap, sd, n=20000):
    """Return the mutual information between two equally probable hypotheses and a reading [nats]."""
    y = rng.choice([0.0, gap], size=n) + sd * rng.normal(size=n)
    like = np.exp(-0.5 * ((y[:, None] - [0.0, gap]) / sd) ** 2)
    p = like / like.sum(axis=1, keepdims=True)
    return float(np.log(2) + np.mean(np.sum(p * np.log(np.maximum(p, 1e-300)), axis=1)))


gains = {sd: mutual_information(4.0, sd) for sd in (0.2, 2.0, 8.0)}
print("information about the block [nats]:", {sd: round(gain, 3) for sd, gain in gains.items()})

# %%
# Question 4: a session
# ---------------------
#
# ``Session.ask`` chooses by this information. Run it on the block with a goal of 0.5 mm, and compare with random
# touches of the same number. The simulator has no scale error, drift or warp, and ``shared_errors`` states this.
# Otherwise the session assumes them, and they decide how many touches it needs, not the places of the touches.
#
# *Solution.* The session ends when its own probability reaches 95 %. Random touches are worse, because some faces are
# touched too often.

corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * [0.1, 0.06, 0.04]
quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
block = tanteo.part_from_mesh(corners, triangles, unit="m", name="block")
start = tanteo.at_place([block], np.eye(4), np.diag(np.repeat([2e-3, 0.03], 3)) ** 2)
probe = Probe("touch", NoiseLaw.of(SD), contact=True, standoff=0.03)
T = start.Ts[0] @ SE3.exp(np.array([1e-3, -2e-3, 1e-3, 0.02, -0.01, 0.03]))


def run(policy, most):
    """Return the largest corner sd after each touch [mm]."""
    session = Session(start, probe, Sensing(sd=SD, shared_errors=EXACT), tanteo.planning.POLICIES[policy],
                      Stop(probability=None, tolerance=5e-4, max_measurements=most))  # fmt: skip
    surface = tanteo.parts.Surface(block.vertices, block.triangles)
    while isinstance(action := session.ask(), Action):
        origin, along = SE3.apply(SE3.inverse(T), action.origin), action.direction @ T[:3, :3]
        distance = surface.cast(origin[None], along[None]).distances[0] + SD * rng.normal()
        session.tell(action.read(distance))
    return [1e3 * step.corner_sd for step in session.steps]


curves = {"information": run("information", 30)}
curves["random"] = run("random", len(curves["information"]))
for name, curve in curves.items():
    print(f"{name}: {len(curve)} touches, largest corner sd {curve[-1]:.2f} mm")

figure, axes = plt.subplots(figsize=(6, 3.6))
for (name, curve), color in zip(curves.items(), ("#0072b2", "#b84800"), strict=True):
    axes.semilogy(range(1, len(curve) + 1), curve, "o-", color=color, label=name)
axes.set(xlabel="touches", ylabel="largest corner sd [mm]")
axes.yaxis.set_major_formatter("{x:g}")
axes.legend()
figure.tight_layout()
