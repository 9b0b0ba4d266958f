"""Read and write file formats: readings, rigs, results, robot poses. Units are explicit in files and SI in memory.

``read_readings`` and ``write_readings`` handle readings files; ``read_rig`` and ``write_rig`` handle rig files.
``read_prior`` reads a pose prior. ``recognition_json`` writes results. ``read_camera``, ``read_marks`` and
``read_image`` read what an image contributes, and ``sight_json`` writes what was recognized in it.
``pose_from_brand`` and ``pose_as_brand`` convert poses between robot conventions; ``write_pose`` and
``write_work_frame`` write controller code. ``parse_length`` reads quantities with units. ``read_record`` and
``write_record`` handle sessions. Document layouts are classes (``schema``) that one reader fills (``document``).
Submodules are imported on first use.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.io.brands import BRANDS, Brand, brand
    from tanteo.io.camera_file import read_camera
    from tanteo.io.factor_file import read_factor
    from tanteo.io.images import read_image, write_image
    from tanteo.io.marks_csv import read_marks
    from tanteo.io.part_files import part_file, parts_of
    from tanteo.io.pose_syntax import brand_word, parse_pose
    from tanteo.io.pose_text import POSE_NAMES, WrittenPose, check_pose_name, write_pose
    from tanteo.io.poses import pose_as_brand, pose_from_brand
    from tanteo.io.prior_file import prior_brand, read_prior
    from tanteo.io.prior_text import parse_box, parse_pose_prior, parse_table, read_furniture
    from tanteo.io.readings_csv import write_readings
    from tanteo.io.readings_file import format_names, read_readings, read_shifted
    from tanteo.io.record_tables import SessionRecord
    from tanteo.io.result_json import (
        EMPTY,
        differences,
        document_json,
        executed_json,
        explanation_document,
        recognition_document,
        recognition_json,
        sight_json,
    )
    from tanteo.io.rig_file import read_rig, rig_text, shipped_rigs, suspect_metres, write_rig
    from tanteo.io.ros_answers import (
        DIAGNOSTICS,
        MARKERS,
        OK,
        POSE_COVARIANCE,
        WARN,
        Placed,
        diagnostics_message,
        marker_message,
        pose,
        pose_message,
        ros_header,
        transform,
    )
    from tanteo.io.ros_messages import (
        POINT,
        POSE,
        RANGE,
        TF,
        RosMessages,
        RosOptions,
        Row,
        is_usable,
        wanted_topics,
    )
    from tanteo.io.ros_readings import placing, readings_of_messages
    from tanteo.io.scene_file import SceneFile, read_scene
    from tanteo.io.sensor_json import calibration_document, rig_document
    from tanteo.io.session_record import load_record, read_record, resumed, session_document, write_record
    from tanteo.io.stated import Direction, Stated, as_pose, parse_direction
    from tanteo.io.units import parse_angle, parse_length, parse_lengths
    from tanteo.io.whole_text import parse_density, parse_mass, parse_size
    from tanteo.io.work_frames import WorkFrame, WrittenFrame, parse_work_frame, write_work_frame
    from tanteo.io.work_json import distinction_json, part_json, plan_csv, plan_json, sensed_json

__all__ = [
    "BRANDS",
    "DIAGNOSTICS",
    "EMPTY",
    "MARKERS",
    "OK",
    "POINT",
    "POSE",
    "POSE_COVARIANCE",
    "POSE_NAMES",
    "RANGE",
    "TF",
    "WARN",
    "Brand",
    "Direction",
    "Placed",
    "RosMessages",
    "RosOptions",
    "Row",
    "SceneFile",
    "SessionRecord",
    "Stated",
    "WorkFrame",
    "WrittenFrame",
    "WrittenPose",
    "as_pose",
    "brand",
    "brand_word",
    "calibration_document",
    "check_pose_name",
    "diagnostics_message",
    "differences",
    "distinction_json",
    "document_json",
    "executed_json",
    "explanation_document",
    "format_names",
    "is_usable",
    "load_record",
    "marker_message",
    "parse_angle",
    "parse_box",
    "parse_density",
    "parse_direction",
    "parse_length",
    "parse_lengths",
    "parse_mass",
    "parse_pose",
    "parse_pose_prior",
    "parse_size",
    "parse_table",
    "parse_work_frame",
    "part_file",
    "part_json",
    "parts_of",
    "placing",
    "plan_csv",
    "plan_json",
    "pose",
    "pose_as_brand",
    "pose_from_brand",
    "pose_message",
    "prior_brand",
    "read_camera",
    "read_factor",
    "read_furniture",
    "read_image",
    "read_marks",
    "read_prior",
    "read_readings",
    "read_record",
    "read_rig",
    "read_scene",
    "read_shifted",
    "readings_of_messages",
    "recognition_document",
    "recognition_json",
    "resumed",
    "rig_document",
    "rig_text",
    "ros_header",
    "sensed_json",
    "session_document",
    "shipped_rigs",
    "sight_json",
    "suspect_metres",
    "transform",
    "wanted_topics",
    "write_image",
    "write_pose",
    "write_readings",
    "write_record",
    "write_rig",
    "write_work_frame",
]  # fmt: skip

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "camera_file": "read_camera",
        "images": "read_image write_image",
        "marks_csv": "read_marks",
        "part_files": "part_file parts_of",
        "pose_text": "POSE_NAMES WrittenPose check_pose_name write_pose",
        "poses": "pose_as_brand pose_from_brand",
        "brands": "BRANDS Brand brand",
        "factor_file": "read_factor",
        "prior_file": "prior_brand read_prior",
        "prior_text": "parse_box parse_pose_prior parse_table read_furniture",
        "whole_text": "parse_density parse_mass parse_size",
        "pose_syntax": "brand_word parse_pose",
        "readings_csv": "write_readings",
        "readings_file": "format_names read_readings read_shifted",
        "stated": "Direction Stated as_pose parse_direction",
        "result_json": "EMPTY differences document_json executed_json explanation_document recognition_document "
        "recognition_json sight_json",
        "ros_answers": "DIAGNOSTICS MARKERS OK POSE_COVARIANCE WARN Placed diagnostics_message marker_message pose "
        "pose_message ros_header transform",
        "ros_messages": "POINT POSE RANGE TF RosMessages RosOptions Row is_usable wanted_topics",
        "ros_readings": "placing readings_of_messages",
        "rig_file": "read_rig rig_text shipped_rigs suspect_metres write_rig",
        "scene_file": "SceneFile read_scene",
        "record_tables": "SessionRecord",
        "session_record": "load_record read_record resumed session_document write_record",
        "units": "parse_angle parse_length parse_lengths",
        "work_frames": "WorkFrame WrittenFrame parse_work_frame write_work_frame",
        "work_json": "distinction_json part_json plan_csv plan_json sensed_json",
        "sensor_json": "calibration_document rig_document",
    },
)
