"""Border formats: readings, rigs, results, brand poses. Units are explicit here and SI inside.

``read_readings`` and ``write_readings`` for readings files, ``read_rig`` and ``write_rig`` for rig files,
``read_prior`` for what is known of a pose,
``recognition_json`` for results, ``read_camera``, ``read_marks`` and ``read_image`` for what a camera saw and
``sight_json`` for what was made of it, ``pose_from_brand`` and ``pose_as_brand`` for poses, ``parse_length`` for
quantities with units. Records of sessions are in ``tanteo.io.session_record``, which loads much and is not loaded here.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.io.calibration_json import calibration_document
    from tanteo.io.camera_file import read_camera
    from tanteo.io.explanation_json import explanation_document
    from tanteo.io.images import read_image, write_image
    from tanteo.io.marks_csv import read_marks
    from tanteo.io.part_document import part_json
    from tanteo.io.part_files import parts_of
    from tanteo.io.plan_out import distinction_json, plan_csv, plan_json
    from tanteo.io.poses import BRANDS, Brand, pose_as_brand, pose_from_brand
    from tanteo.io.prior_file import prior_brand, read_prior
    from tanteo.io.prior_text import parse_box, parse_pose_prior, parse_table
    from tanteo.io.readings_csv import read_readings
    from tanteo.io.readings_write import write_readings
    from tanteo.io.result_json import document_json, executed_json, recognition_document, recognition_json
    from tanteo.io.rig_checks import suspect_metres
    from tanteo.io.rig_file import read_rig, rig_document, rig_text, shipped_rigs, write_rig
    from tanteo.io.same_answer import differences
    from tanteo.io.scene_file import SceneFile, read_scene
    from tanteo.io.sensed_file import sensed_document, sensed_json
    from tanteo.io.session_record import SessionRecord, load_record, read_record, resumed, write_record
    from tanteo.io.sight_file import EMPTY, sight_document, sight_json
    from tanteo.io.units import parse_angle, parse_length, parse_lengths

__all__ = [
    "BRANDS",
    "EMPTY",
    "Brand",
    "SceneFile",
    "SessionRecord",
    "calibration_document",
    "differences",
    "distinction_json",
    "document_json",
    "executed_json",
    "explanation_document",
    "load_record",
    "parse_angle",
    "parse_box",
    "parse_length",
    "parse_lengths",
    "parse_pose_prior",
    "parse_table",
    "part_json",
    "parts_of",
    "plan_csv",
    "plan_json",
    "pose_as_brand",
    "pose_from_brand",
    "prior_brand",
    "read_camera",
    "read_image",
    "read_marks",
    "read_prior",
    "read_readings",
    "read_record",
    "read_rig",
    "read_scene",
    "recognition_document",
    "recognition_json",
    "resumed",
    "rig_document",
    "rig_text",
    "sensed_document",
    "sensed_json",
    "shipped_rigs",
    "sight_document",
    "sight_json",
    "suspect_metres",
    "write_image",
    "write_readings",
    "write_record",
    "write_rig",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "plan_out": "distinction_json plan_csv plan_json",
        "explanation_json": "explanation_document",
        "same_answer": "differences",
        "part_document": "part_json",
        "rig_checks": "suspect_metres",
        "calibration_json": "calibration_document",
        "session_record": "SessionRecord load_record read_record resumed write_record",
        "part_files": "parts_of",
        "camera_file": "read_camera",
        "images": "read_image write_image",
        "marks_csv": "read_marks",
        "poses": "BRANDS Brand pose_as_brand pose_from_brand",
        "prior_text": "parse_box parse_pose_prior parse_table",
        "prior_file": "prior_brand read_prior",
        "readings_csv": "read_readings",
        "readings_write": "write_readings",
        "result_json": "document_json executed_json recognition_document recognition_json",
        "rig_file": "read_rig rig_document rig_text shipped_rigs write_rig",
        "scene_file": "SceneFile read_scene",
        "sensed_file": "sensed_document sensed_json",
        "sight_file": "EMPTY sight_document sight_json",
        "units": "parse_angle parse_length parse_lengths",
    },
)
