r"""
Which of twenty brackets
========================

Twenty brackets of one family are similar; some differ by a millimetre. A laser reads some points of one of them. This
notebook identifies the bracket, shows the number of readings that this takes, and discriminates two that remain.

Run it from the repository: ``python docs/notebooks/02_which_of_twenty_brackets.py``.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.planning import Probe, discriminate
from tanteo.planning.following import next_reading
from tanteo.posterior import prepare
from tanteo.sensors import Readings
from tanteo.sensors.presets import NoiseLaw

# %%
# The brackets
# ------------
#
# A bracket is an extruded angle with a slanted foot, given by five dimensions. Every point of the profile is visible
# from the inner corner, so its faces are triangle fans.


def bracket(foot, wall, thick, slant, width):
    """Return an angle bracket as the text of an OFF file in millimetres."""
    profile = [(thick, thick), (thick, wall), (0, wall), (0, 0), (foot, 0), (foot - slant, thick)]
    n = len(profile)
    vertices = [(x, y, z) for y in (0, width) for x, z in profile]
    fan = [(0, i, i + 1) for i in range(1, n - 1)]
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    faces = [(a, c, b) for a, b, c in fan] + [(n + a, n + b, n + c) for a, b, c in fan]
    faces += [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    lines = [f"OFF {len(vertices)} {len(faces)} 0", *(" ".join(map(str, v)) for v in vertices)]
    return "\n".join([*lines, *(" ".join(map(str, (3, *f))) for f in faces)])


dimensions = [(f, w, t, 4, 30) for f in (60, 61, 80) for w in (40, 50) for t in (5, 6)]
dimensions += [(f, 45, 5, s, b) for f in (60, 70) for s in (4, 7) for b in (30, 32)]
with TemporaryDirectory() as folder:
    parts = []
    for size in dimensions:
        file = Path(folder) / "{}x{}x{}s{}b{}.off".format(*size)
        file.write_text(bracket(*size))
        parts.append(read_part(file, unit="mm"))
print(len(parts), "brackets, the first:", parts[0])

# %%
# The readings
# ------------
#
# One bracket lies at an unknown pose. A laser with a noise of 0.1 mm reads random points on random faces, from above
# and from the sides. There is no prior knowledge of the part or its pose.

SD = 1e-4
true = parts[3]
truth = SE3.from_parts(SO3.exp(np.radians([2.0, -1.0, 50.0])), np.array([0.3, 0.1, 0.02]))


def read(part, n, seed):
    """Return readings of random points on random faces, along their normals, except from below."""
    rng = np.random.default_rng(seed)
    corners = part.vertices[part.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(cross, axis=1)
    normals = cross / areas[:, None]
    share = areas / np.bincount(part.triangle_face, areas)[part.triangle_face] * (normals[:, 2] > -0.5)
    rows = rng.choice(len(corners), size=n, p=share / share.sum())
    places = np.einsum("ni,nij->nj", rng.dirichlet(np.ones(3), size=n), corners[rows])
    local = places + SD * rng.normal(size=(n, 1)) * normals[rows]
    directions = -normals[rows] @ truth[:3, :3].T
    return Readings.from_columns(SE3.apply(truth, local), directions=directions, sds=np.full(n, SD))


readings = read(true, 24, seed=4)

# %%
# The answer
# ----------
#
# Every bracket and the unknown object get a probability; the sum is one.


def probabilities(answer):
    """Return the probability of every bracket and of the unknown object."""
    out = dict.fromkeys([part.name for part in parts], 0.0)
    for h in answer.hypotheses:
        out[h.part] += h.probability
    return out | {"unknown object": answer.unknown_probability}


counts = (6, 12, 24)
answers = [tanteo.identify(readings.take(np.arange(n)), parts, top=20) for n in counts]
print(answers[-1].status, "-", answers[-1].message)
print("true:", true.name)

# %%
# The picture
# -----------
#
# With few readings several brackets are possible. More readings concentrate the probability on one: the true bracket
# is blue.

figure, axes = plt.subplots(1, len(counts), sharey=True, figsize=(10, 6))
for axis, n, found in zip(axes, counts, answers, strict=True):
    P = probabilities(found)
    colours = ["#0072b2" if name == true.name else "#8a949e" for name in P]
    axis.barh(list(P), list(P.values()), color=colours)
    axis.set(title=f"{n} readings: {found.status}", xlim=(0, 1), xticks=(0, 0.5, 1), xlabel="probability")
axes[0].invert_yaxis()
axes[0].tick_params(axis="y", labelsize=9)
figure.tight_layout()

# %%
# The figure
# ----------

for n, found in zip(counts, answers, strict=True):
    P = probabilities(found)
    best = max(P, key=P.__getitem__)
    print(f"{n:3d} readings: P({true.name}) = {P[true.name]:.3f}, the most probable is {best} ({P[best]:.3f})")

# %%
# Where it can go wrong
# ---------------------
#
# **Two brackets that the readings do not discriminate.** They differ by a millimetre at the end of the foot, where
# there is no reading. The answer has the status *ambiguous*. ``next_reading`` finds the reading that would decide: its
# start, its direction, and the range that each bracket predicts.

twins = [parts[0], parts[4]]
print("twins:", " and ".join(twin.name for twin in twins))
seen = read(twins[0], 30, seed=7)
away = seen.take(SE3.apply(SE3.inverse(truth), seen.points)[:, 0] < 0.05)
undecided = tanteo.identify(away, twins)
print(undecided.status, "-", undecided.message)
laser = Probe("laser", NoiseLaw.of(SD), standoff=0.05)
step = next_reading(undecided, twins, laser).finding
print("from", 1e3 * np.round(step.start, 4), "mm along", np.round(step.direction, 2) + 0.0)
for one in step.expected:
    hit = np.isfinite(one.distance)
    print(f"  {one.part}:", f"{1e3 * one.distance:.2f} mm, sd {1e3 * one.sd:.2f} mm" if hit else "no surface")

# %%
# The best reading can be computed before any other, too. Both brackets are aligned as well as possible, and the laser
# reads where they still differ.

best = discriminate(*map(prepare, twins), laser)
print("from", (1e3 * best.origin).round(1), "mm along", best.direction.round(2) + 0.0)
print(best.message)

# %%
# **A bracket that is not among the twenty.** Each of its dimensions is between those of the others. With 24 readings
# the goodness-of-fit test rejects the most similar bracket. With few readings it does not, because surfaces without
# readings cannot contradict.

with TemporaryDirectory() as folder:
    file = Path(folder) / "other.off"
    file.write_text(bracket(65, 47.5, 5.5, 5, 31))
    other = read_part(file, unit="mm")
found = tanteo.identify(read(other, 24, seed=5), parts)
print(found.status, "-", found.message)
