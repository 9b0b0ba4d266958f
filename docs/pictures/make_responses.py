"""Draw ``docs/pictures/responses.svg``, what a device reports of its cone: ``python docs/pictures/make_responses.py``.

A sensor faces a step from above. The rays of its cone hit the upper face, the lower face or the side. Each panel has
the range that one response reports of them.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.patches import Arc

SENSOR = np.array([0.0, 100.0])
HALF_ANGLE = np.radians(18)
EDGE, TOP = -6.0, 40.0  # mm: the step is on the left of x = EDGE
GREY, BLUE, RED = "#9aa4ad", "#2b6cb0", "#c53030"

RESPONSES = {
    "ray": "one ray of the cone, at random",
    "nearest": "the nearest point in the cone",
    "mean": "the mean over the cone",
    "strongest": "the mean over the face that returns most",
}


def _cast(angles):
    """Return ranges of rays at angles to the axis, and the face that each hits: 0 the floor, 1 the step, 2 its side."""
    direction = np.stack([np.sin(angles), -np.cos(angles)], axis=1)
    floor, top = SENSOR[1] / -direction[:, 1], (SENSOR[1] - TOP) / -direction[:, 1]
    on_top = top * direction[:, 0] <= EDGE
    with np.errstate(divide="ignore", invalid="ignore"):
        side = EDGE / direction[:, 0]
    on_side = ~on_top & (side > 0) & (side < floor)
    return np.where(on_top, top, np.where(on_side, side, floor)), np.where(on_top, 1, np.where(on_side, 2, 0))


def _reported(response, ranges, faces):
    if response == "ray":
        return ranges[len(ranges) * 3 // 4]
    if response == "nearest":
        return ranges.min()
    if response == "mean":
        return ranges.mean()
    most = np.argmax(np.bincount(faces, weights=1 / ranges**2))
    return ranges[faces == most].mean()


def main():
    """Draw the picture."""
    angles = np.linspace(-HALF_ANGLE, HALF_ANGLE, 13)
    ranges, faces = _cast(angles)
    ends = SENSOR + ranges[:, None] * np.stack([np.sin(angles), -np.cos(angles)], axis=1)
    figure, panels = plt.subplots(1, 4, figsize=(11, 3.6), sharey=True)
    for panel, (response, words) in zip(panels, RESPONSES.items(), strict=True):
        r = _reported(response, ranges, faces)
        used = {
            "ray": np.arange(13) == 13 * 3 // 4,
            "nearest": ranges == ranges.min(),
            "mean": np.ones(13, dtype=bool),
            "strongest": faces == np.argmax(np.bincount(faces, weights=1 / ranges**2)),
        }[response]
        panel.fill([-60, EDGE, EDGE, 60, 60, -60], [TOP, TOP, 0, 0, -12, -12], color="#e2e6ea", edgecolor=GREY)
        for end, one in zip(ends, used, strict=True):
            panel.plot(*np.stack([SENSOR, end]).T, color=BLUE if one else GREY, lw=1.6 if one else 0.7)
        panel.add_patch(Arc(SENSOR, 2 * r, 2 * r, theta1=270 - 24, theta2=270 + 24, color=RED, lw=2.2))
        panel.plot(*SENSOR, marker="s", color="#2d3748", ms=9)
        panel.set_title(f"{response}: {r:.0f} mm", fontsize=12)
        panel.text(0, -21, words, ha="center", va="top", fontsize=8.5)
        panel.set(xlim=(-48, 48), ylim=(-30, 108), aspect="equal")
        panel.axis("off")
    figure.tight_layout(pad=0.4)
    path = Path(__file__).with_name("responses.svg")
    mpl.rcParams |= {"svg.hashsalt": "tanteo", "svg.fonttype": "none"}
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
