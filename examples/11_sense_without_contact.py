"""Sense an edge and its face without contact from a rough initial guess, in a simulated cell.

``SimulatedHand`` is a ``Robot``: a hand with range sensors that takes one velocity command in each period. A driver of
a real hand with the same members can replace it. The recorded readings reproduce the same features.

    python examples/11_sense_without_contact.py
"""

import tempfile
from pathlib import Path

import numpy as np

import tanteo
from tanteo.hand.acquisition import features_of, sense_edge
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import SimulatedHand, clearances
from tanteo.io import read_scene, write_readings

scene = read_scene(Path(__file__).parent / "scenes" / "bracket.toml")
robot = SimulatedHand(
    scene.scene, scene.hand, scene.T_world_hand, rng=np.random.default_rng(scene.seed), cell=scene.cell
)
rules = Rules(clearance=scene.clearance, workspace=scene.workspace)
got = sense_edge(robot, scene.guesses["edge"], standoff=scene.standoff, rules=rules)

print(f"{got.status}: {got.message}, {len(got.readings)} readings, {got.seconds:.0f} s")
for motion in got.motions[:6]:
    print(f"  {motion.name:10} {motion.status:8} {motion.message}")
for feature in (got.feature, *got.others):
    sd = 1e3 * np.sqrt(feature.P[0, 0])
    place = np.round(1e3 * feature.T_world_feature[:3, 3], 2)
    print(f"{feature.label}: {feature.kind.name} at {place} mm, sd {sd:.2f} mm")

# only the simulator has the true clearance of the hand
print(f"smallest clearance {1e3 * clearances(scene.scene, scene.hand.body, np.array(robot.truth)).min():.1f} mm")

with tempfile.TemporaryDirectory() as folder:
    write_readings(got.readings, Path(folder) / "record.csv", unit="m")
    again, _ = features_of(tanteo.read_readings(Path(folder) / "record.csv"), scene.hand.rig)
same = np.array_equal(again["edge"].T_world_feature, got.feature.T_world_feature)
print(f"the record gives the same edge to the last bit: {same}")
