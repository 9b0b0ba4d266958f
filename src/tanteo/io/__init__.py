"""Border formats: readings, rigs, results, brand poses. Units are explicit here and SI inside.

``read_readings`` and ``write_readings`` for readings files, ``read_rig`` and ``write_rig`` for rig files,
``recognition_json`` for results, ``pose_from_brand`` and ``pose_as_brand`` for poses, ``parse_length`` for
quantities with units.
"""

from tanteo.io.poses import BRANDS, Brand, pose_as_brand, pose_from_brand
from tanteo.io.readings_csv import read_readings
from tanteo.io.readings_write import write_readings
from tanteo.io.result_json import recognition_document, recognition_json
from tanteo.io.rig_toml import read_rig, shipped_rigs
from tanteo.io.rig_write import rig_text, write_rig
from tanteo.io.scene_toml import SceneFile, read_scene
from tanteo.io.sensed_json import sensed_document, sensed_json
from tanteo.io.units import parse_angle, parse_length, parse_lengths

__all__ = [
    "BRANDS",
    "Brand",
    "SceneFile",
    "parse_angle",
    "parse_length",
    "parse_lengths",
    "pose_as_brand",
    "pose_from_brand",
    "read_readings",
    "read_rig",
    "read_scene",
    "recognition_document",
    "recognition_json",
    "rig_text",
    "sensed_document",
    "sensed_json",
    "shipped_rigs",
    "write_readings",
    "write_rig",
]
