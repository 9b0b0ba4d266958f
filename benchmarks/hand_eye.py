"""Compare hand-eye calibration with the solvers of KinHEC: ``python benchmarks/hand_eye.py FOLDER``.

KinHEC (PyPI, MIT) generates sequences of robots and cameras with known truth; ``kinhec generate --tier smoke --out
FOLDER`` makes 46. Printed are, by track, the median error of the hand-eye position, that of the best of its solvers
(selected by the truth), the mean NEES, and the number of insufficient calibrations. Tracks ``monocular`` and ``mixed``
have targets of unknown size, late images and drifts, which are not modelled here.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np
from kinhec import benchmark, io

from tanteo.geometry import SE3
from tanteo.sensors.calibration import calibrate_hand_eye

MM = 1e3


def error_of(T: np.ndarray, truth: np.ndarray) -> float:
    """Return the distance of two positions [mm]."""
    return MM * float(np.linalg.norm(T[:3, 3] - truth[:3, 3]))


def main() -> None:
    """Print a row for each track."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("folder", type=Path, help="folder that kinhec generated")
    folder = parser.parse_args().folder
    errors: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    nees, refused = defaultdict(list), defaultdict(int)
    for row in io.load_manifest(folder).to_dict("records"):
        sequence = io.load_sequence(folder, row["sequence_id"])
        offset = None if sequence.synchronous else sequence.time_offset
        data = benchmark._keyframe_data(sequence, offset)
        A, B = data[0], data[1]
        track, on_hand = row["track"], row["configuration"] == "eye_in_hand"
        for name, solve in benchmark.SOLVERS.items():
            try:
                found = error_of(solve(data, np.random.default_rng(0))["X"], sequence.X)
            except (ValueError, np.linalg.LinAlgError):
                found = np.inf
            errors[track][name].append(found)
        ours = calibrate_hand_eye(A, SE3.inverse(B) if on_hand else B, mounted="hand" if on_hand else "world")
        T, C = (ours.T_mount_camera, ours.covariance) if on_hand else (ours.T_other_target, ours.covariance_target)
        errors[track]["tanteo"].append(error_of(T, sequence.X))
        difference = SE3.log(SE3.inverse(T) @ sequence.X)
        nees[track].append(float(difference @ np.linalg.solve(C, difference)) / 6)
        refused[track] += ours.status == "insufficient"
    print("| track | sequences | tanteo, mm | best solver, mm | its name | mean NEES | insufficient |")
    print("|---|---|---|---|---|---|---|")
    for track, found in errors.items():
        medians = {name: float(np.median(one)) for name, one in found.items() if name != "tanteo"}
        best = min(medians, key=medians.__getitem__)
        print(
            f"| {track} | {len(nees[track])} | {np.median(found['tanteo']):.2f} | {medians[best]:.2f} | {best} "
            f"| {np.mean(nees[track]):.2f} | {refused[track]} |"
        )


if __name__ == "__main__":
    main()
