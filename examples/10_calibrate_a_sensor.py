"""Calibrate the mounting and the errors of a range sensor from ranges of flat surfaces.

The log has ranges of a table and a wall from 48 poses of the hand. The poses of table and wall are unknown. The sensor
is mounted slightly differently from the rig file, reads too far, and saturates at 450 mm. The result is a rig whose
mounting and scale have the covariance of the calibration, so that points measured with it have a true covariance.

    python examples/10_calibrate_a_sensor.py
"""

from pathlib import Path

import numpy as np

import tanteo
from tanteo.io import read_rig
from tanteo.sensors import calibrate, measure
from tanteo.sensors.calibration import calibrated_rig, plane_angle

HERE = Path(__file__).parent / "readings"
log, drawn = tanteo.read_readings(HERE / "plane_log.csv"), read_rig(HERE / "tof_rig.toml")
found = calibrate(log, rig=drawn)
print(f"{found.status}: {found.message}")

beam = found.beams[0]
sds = np.sqrt(np.diag(beam.cov))
print(f"beam from {np.round(1e3 * beam.T_hand_beam[:3, 3], 1)} mm (truth, with its bias: 1.3 38.2 59.1)")
print(f"reads {1 + beam.scale:.4f} times the range, sd {sds[5]:.4f} (truth 1.012)")
print(f"saturated places: {sum(outlier.reason == 'saturated' for outlier in found.outliers)}")
angle, sd = plane_angle(found, "table", found, "wall")
print(f"table and wall at {np.degrees(angle):.2f} deg, sd {np.degrees(sd):.2f} (truth 90)")

used = np.isin(log.ids, [name for outlier in found.outliers for name in outlier.ids], invert=True)
top = log.take(used & np.array([label == "table" for label in log.features]))
for name, rig in (("as drawn", drawn), ("calibrated", calibrated_rig(found, rig=drawn))):
    measured = measure(top, rig=rig)
    height = 1e3 * measured.points[:, 2]
    stated = 1e3 * np.sqrt(measured.total_covs()[:, 2, 2]).mean()
    print(f"{name}: table at {height.mean():.1f} mm, spread {height.std():.1f} mm, stated sd {stated:.1f} mm (truth 0)")
