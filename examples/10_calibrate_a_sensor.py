"""Where a range sensor really sits, how it errs and which readings to distrust: from ranges of flat surfaces.

The log holds ranges of a table and a wall from 48 poses of the hand; where table and wall are is not known. The sensor
sits a little off where the rig has it, reads too far, and stops at 450 mm. What comes out is a rig, whose mounting and
scale carry the covariance that they were found with: points measured with it know how sure they are.

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
    said = 1e3 * np.sqrt(measured.total_covs()[:, 2, 2]).mean()
    print(f"{name}: table at {height.mean():.1f} mm, spread {height.std():.1f} mm, said {said:.1f} mm (truth 0)")
