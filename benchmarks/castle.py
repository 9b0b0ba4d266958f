"""A few pixels of real depth frames as beams, without an initial pose: ``python benchmarks/castle.py [draws]``.

Beside the answers the table has the limit of these readings: how often a pose drawn from the posterior about the truth
is
near enough to count as right. An estimator that starts at the truth would have this posterior.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

from bare_scenes import nees, no_paths, off
from castle_scene import FRAMES, castle, dense_fit, first_pose, pixels_of
from tanteo.geometry import SE3
from tanteo.posterior import Priors, Problem, as_hypothesis, identify_points, prepare
from tanteo.posterior.fit_at_mode import goodness_of_fit
from tanteo.posterior.update import posterior_about

RIGHT = 3e-3, np.radians(1.5)


def share_right(part, covariance, rng, draws=300):
    """Return how often an error drawn from a covariance is small enough to count as right."""
    errors = SE3.exp(rng.multivariate_normal(np.zeros(6), covariance, draws))
    moved = np.linalg.norm(SE3.apply(errors, part.centroid) - part.centroid, axis=1)
    turned = np.linalg.norm(SE3.log(errors)[:, 3:], axis=1)
    return np.mean((moved < RIGHT[0]) & (turned < RIGHT[1]))


def covariance_at(target, touches, T):
    """Return the covariance ``(6, 6)`` that an answer states for the maximum next to a pose."""
    problem = Problem(touches, no_paths(), Priors(radius=target.part.radius))
    mode = posterior_about(problem, target, T[None], np.random.default_rng(0)).modes[0]
    return as_hypothesis(touches, goodness_of_fit(mode)).covariance


def mm(lengths):
    """Least and most of some lengths."""
    return f"{1e3 * min(lengths):.1f} to {1e3 * max(lengths):.1f} mm"


def main():
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    with tempfile.TemporaryDirectory() as folder:
        target = prepare(castle(folder))
    T, rows = first_pose(), []
    for frame in FRAMES:
        T = dense_fit(target.surface, frame, T)
        pixels = pixels_of(target.part, target.surface, frame, T)
        for n in (24, 12):
            rng, best, near, region = np.random.default_rng((frame, n)), 0, 0, 0
            values, sds, hoped, bounds = [], [], [], []
            statuses, start = Counter(), time.process_time()
            for _ in range(draws):
                touches = pixels.draw(n, rng)
                bounds.append(share_right(target.part, covariance_at(target, touches, T), rng))
                answer = identify_points(touches, no_paths(), [target], top=10_000)
                gaps = [off(target.part, h.T_world_part, T) for h in answer.hypotheses]
                squares = [nees(target.part, h.T_world_part, h.covariance, T)[0] for h in answer.hypotheses]
                right = [moved < RIGHT[0] and angle < RIGHT[1] for moved, angle in gaps]
                best, near = best + bool(right and right[0]), near + any(right)
                region += any(right) or min(squares, default=np.inf) < 22.5
                statuses[answer.status] += 1
                if right and right[0]:
                    values.append(squares[0])
                sds += [h.corner_sd for h in answer.hypotheses[:1]]
                hoped += [h.probability * share_right(target.part, h.covariance, rng) for h in answer.hypotheses[:1]]
            rows.append((
                f"{frame}", f"{n}", f"{1e3 * pixels.sd:.2f} mm ({mm(pixels.sd_of_face.values())})",
                f"{1e3 * pixels.tolerance:.2f} mm",
                f"{100 * best / draws:.0f} %", f"{100 * np.mean(hoped):.0f} %", f"{100 * np.mean(bounds):.0f} %",
                f"{100 * near / draws:.0f} %", f"{100 * region / draws:.0f} %", f"{np.mean(values) / 6:.2f}",
                f"{1e3 * np.median(sds):.1f} mm",
                ", ".join(f"{v} {k}" for k, v in statuses.most_common()),
                f"{1e3 * (time.process_time() - start) / draws:.0f} ms",
            ))  # fmt: skip
    columns = (
        "frame", "pixels", "noise (by face)", "shared by a face", "best right", "as its covariance predicts",
        "as that at the truth allows", "a mode right", "truth in some mode", "NEES / dof of the right",
        "largest corner sd", "answers", "time",
    )  # fmt: skip
    text = f"{draws} draws for each; right is within 3 mm and 1.5 degrees of the dense fit."
    print(Table("Pixels of a depth camera", text, columns, rows).markdown())


if __name__ == "__main__":
    main()
