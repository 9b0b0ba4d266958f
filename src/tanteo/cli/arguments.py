"""Declare the options that several commands share, each with its group in ``--help``.

This module imports only the parser; ``typed.py`` converts the typed values.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tanteo import io
from tanteo.cli import error_options, typed
from tanteo.cli.error_options import Errors
from tanteo.cli.typed import Words
from tanteo.defaults import SIGNIFICANCE, TOP

if TYPE_CHECKING:
    from tanteo.geometry import UncertainFrame
    from tanteo.geometry.typing import FloatArray
    from tanteo.posterior import Table
else:  # the parser resolves annotations; these names avoid slow imports
    Errors = FloatArray = Table = UncertainFrame = Any


def option(names: str, metavar: str | None, words: str, **more: Any) -> Any:
    """Return an option in the form of the parser.

    Args:
        names: names of the option, separated by blanks.
        metavar: placeholder of the value in ``--help``; None for the type.
        words: help text.
        more: further arguments of ``typer.Option``.
    """
    return typer.Option(*names.split(), metavar=metavar, help=words, **more)


_readings = partial(option, rich_help_panel="Readings and parts")
_errors = partial(option, rich_help_panel="Errors")
_prior = partial(option, rich_help_panel="Prior knowledge")
_reach = partial(option, rich_help_panel="Probe and reach")
_image = partial(option, rich_help_panel="Image")
sensing = partial(option, rich_help_panel="Sensing")
_answer = partial(option, rich_help_panel="Answer")
_output = partial(option, rich_help_panel="Output")

SENSOR_HELP = "Preset of the sensor's errors; tanteo sensor list has the names."
ROBOT_HELP = "Preset of the robot's errors; tanteo sensor list has the names."
UNITS_HELP = "Unit of files that state none (logs, clouds, STL, OBJ, OFF): mm, m, um or in; of parts also cm or ft."
_seed = partial(typed.at_least, "--seed", 0, "Use 0")
SEED, UNIT = Words(_seed, int), Words(typed.unit)
PRESET, ROBOT, STANDOFF = Words(typed.preset), Words(typed.robot), Words(typed.standoff)

ReadingsPath = Annotated[str, typer.Argument(metavar="READINGS", help="File of readings: CSV, probe log, cloud, ...")]
PartPaths = Annotated[
    list[str], _readings("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL), folders of them, or a catalogue.")
]
PartPath = Annotated[str, _readings("--part", "FILE", "CAD file of the part (STEP, STL, ...).")]
Units = Annotated[str | None, _readings("--units", "UNIT", UNITS_HELP), UNIT]
RigPath = Annotated[str | None, _readings("--rig", "FILE", "Poses of the range sensors on the hand (TOML).")]

Sensor = Annotated[str | None, _errors("--sensor", "NAME", SENSOR_HELP, autocompletion=typed.sensor_names), PRESET]
Sd = Annotated[
    float | None,
    _errors("--sd", "LENGTH", "Standard deviation of readings without their own, as 0.3mm."),
    Words(partial(typed.spread, "--sd", True)),
]
FormSd = Annotated[
    float,
    _errors(
        "--form-sd",
        "LENGTH",
        "Standard deviation of the made part's surface from its CAD, as 0.1mm, or machined (0.05 mm), printed "
        "(0.15 mm) or cast (0.25 mm).",
    ),
    Words(typed.form_sd, str, "0mm"),
]
Robot = Annotated[str | None, _errors("--robot", "PRESET", ROBOT_HELP, autocompletion=typed.robot_names), ROBOT]
ArmPath = Annotated[
    str | None,
    _errors(
        "--arm", "FILE", "Joints of the robot: robot.urdf#HAND or #BASE/HAND, or a Denavit-Hartenberg table (CSV)."
    ),
]
JointAngles = Annotated[
    str | None,
    _errors("--joints", "ANGLES", "Joint angles near one reading, as 0,-90,90,-90,-90,0deg, or a file with j1_deg .."),
]
JointSd = Annotated[
    float,
    _errors("--joint-sd", "ANGLE", "Standard deviation of the zero of each joint of --arm."),
    Words(partial(typed.angle_sd, "--joint-sd"), str, "0.1deg"),
]
TipSd = Annotated[
    tuple[float, ...] | None,
    _errors(
        "--tip-sd",
        "X,Y,Z",
        "Standard deviations of the tip's offset in the hand, as 1.5,1.5,0.3mm; 0.3 mm each with poses of the hand if "
        "not given, 0,0,0mm if exact.",
    ),
    Words(typed.tip),
]

BiasSd = Annotated[
    Errors | None,
    _errors(
        "--bias-sd",
        "[NAME=]LENGTH,...",
        "Standard deviation of an offset along the approach, one across and one along z, as 0.05mm; or xy=, z=, "
        "common= (the same in all directions), backlash=, lobes=, group= (of each value of the column group).",
    ),
    Words(error_options.bias),
]
ScaleSd = Annotated[
    Errors | None,
    _errors("--scale-sd", "FRACTION", "Standard deviation of the world's scale about its origin, as 100ppm."),
    Words(error_options.scale),
]
DriftSd = Annotated[
    Errors | None,
    _errors(
        "--drift-sd",
        "[NAME=]LENGTH",
        "Standard deviation of the drift over the run, as 0.1mm; trigger= of the trigger.",
    ),
    Words(error_options.drift),
]
WarpSd = Annotated[
    Errors | None,
    _errors("--warp-sd", "LENGTH", "Standard deviation of a smooth deviation of the part (bending, warp), as 0.2mm."),
    Words(error_options.warp),
]
FanSd = Annotated[
    Errors | None,
    _errors("--fan-sd", "ANGLE", "Standard deviation of the angles of a range sensor's beams, as 0.3deg."),
    Words(error_options.fan),
]
Stock = Annotated[
    Errors | None,
    _errors("--stock", "[uniform=]LENGTH", "Material on each face of the CAD, from none to about this, as 3mm."),
    Words(error_options.stock),
]
NoiseFactor = Annotated[
    float | None,
    _errors(
        "--noise-factor",
        "FACTOR",
        "Factor to which the noise is known (1: exactly as stated); 2 if not given, 1.5 with a preset.",
    ),
]

FurniturePaths = Annotated[
    list[str] | None,
    _prior(
        "--furniture",
        "FILE@POSE+-SD",
        "CAD file and pose of a known object in the scene, as 'vise.stl@400,200,0mm 0,0,90deg +- 0.5mm'.",
    ),
]
TableAt = Annotated[
    Table | None,
    _prior("--table", "HEIGHT", "The part rests on a level table at this height, as 0+-1mm."),
    Words(lambda text: io.poses.parse_table(text, "--table")),
]
RestsAt = Annotated[
    list[Any] | None,
    _prior(
        "--rests",
        "POINT NORMAL",
        "The part touches this plane of a fixture, as '120,0,0mm -1,0,0 +- 0.1mm' with the normal towards the part; "
        "may be repeated (fixed jaw, rails, two faces of a V-block).",
    ),
    Words(typed.rests, list[str] | None),
]
BoxAt = Annotated[
    FloatArray | None,
    _prior("--box", "LOW,HIGH", "The part is in this box of the world, as 0,0,0,500,400,200mm."),
    Words(lambda text: io.poses.parse_box(text, "--box")),
]
PosePriorAt = Annotated[
    UncertainFrame | None,
    _prior("--pose-prior", "POSE", "The part is near this pose, as '400,200,0mm 0,0,90deg +- 5mm 3deg'."),
    Words(typed.pose),
]
PriorPath = Annotated[str | None, _prior("--prior", "FILE", "Table, box and pose prior from a file (TOML).")]
OutlierRate = Annotated[
    float | None,
    _prior("--outlier-rate", "SHARE", "Expected outlier fraction, as 10%; if not given, that of --sensor, else 1%."),
    Words(partial(typed.share, "--outlier-rate", 0.5, "one half")),
]
UnknownPrior = Annotated[
    float | None,
    _prior("--unknown-prior", "SHARE", "Prior probability that the object is unknown, as 0.1%; 5% if not given."),
    Words(partial(typed.share, "--unknown-prior", 1.0, "one")),
]

WorkspaceBox = Annotated[
    FloatArray | None,
    _reach("--workspace", "LOW,HIGH", "Box of permitted tip positions, as 0,0,-50,300,200,120mm."),
    Words(lambda text: io.poses.parse_box(text, "--workspace")),
]
Forbid = Annotated[
    list[Any] | None,
    _reach("--forbid", "CORNERS", "Forbidden box: two corners, as 150,0,0,180,60,250mm; may be repeated."),
    Words(typed.forbidden, list[str] | None),
]
ToolBody = Annotated[
    FloatArray | None,
    _reach(
        "--tool-body", "STYLUS,RADIUS,LENGTH", "Length of the stylus, radius and length of the tool, as 50,30,150mm."
    ),
    Words(typed.tool_body),
]
ToolTilt = Annotated[
    float | None,
    _reach("--tool-tilt", "ANGLE", "Largest tilt of the tool from upright, as 30deg; 0deg if it stays upright."),
    Words(typed.tilt),
]
AxisParallel = Annotated[
    bool, _reach("--axis-parallel", None, "Approach only along the axes of the world, as a milling machine does.")
]
Approach = Annotated[
    Any,
    _reach("--approach", "DIR,ANGLE", "Direction of beam or approach, and the largest angle to it, as 0,0,-1,60deg."),
    Words(typed.approach),
]
TouchStandoff = Annotated[
    float | None,
    _reach("--standoff", "LENGTH", "Distance from the surface at which a reading starts, as 20mm; 50mm if not given."),
    STANDOFF,
]
Clearance = Annotated[
    float | None,
    _reach("--clearance", "LENGTH", "Radius of free space around the probe, as 10mm, which is the default."),
    Words(partial(typed.length, "--clearance", "10mm")),
]
TipRadius = Annotated[
    float | None,
    _reach("--tip-radius", "LENGTH", "Radius of the probe's ball, as 1.5mm; 0mm for a sharp tip."),
    Words(typed.tip_radius),
]

Mass = Annotated[
    tuple[float, float] | None,
    _prior("--mass", "MASS", "Measured mass of the object, as 340g+-2g; needs --density."),
    Words(lambda text: io.documents.parse_mass(text, "--mass")),
]
Density = Annotated[
    tuple[float, float] | None,
    _prior("--density", "DENSITY", "Density of the material, as 7.85g/cm3+-1%."),
    Words(lambda text: io.documents.parse_density(text, "--density")),
]
Size = Annotated[
    Any,
    _prior("--size", "A,B,C", "Sides of a bounding box of the object, in any order, as 120,80,50mm+-1mm."),
    Words(lambda text: io.documents.parse_size(text, "--size")),
]

Factors = Annotated[
    list[str] | None,
    _prior(
        "--factor",
        "NAME=FILE",
        "Further measurement of the pose, which the plug-in NAME reads; may be repeated.",
    ),
]

ImagePaths = Annotated[
    list[str] | None,
    _prior("--image", "FILE", "Image of the object on a table, beside the readings; may be repeated. Needs --camera."),
]
CameraPaths = Annotated[
    list[str] | None,
    _prior(
        "--camera",
        "FILE",
        "Calibration file of the camera, one for all images or one each; the file or --marks states the pose of "
        "the camera.",
    ),
]
MarksPaths = Annotated[
    list[str] | None,
    _prior("--marks", "FILE", "Known points of the table and their pixels in the image, to place the camera (CSV)."),
]

HandPosesPath = Annotated[
    str | None,
    _prior(
        "--hand-poses",
        "FILE",
        "Poses of the hand at which its camera took the images, one row each (CSV). Needs --hand-eye.",
    ),
]
HandEyePath = Annotated[
    str | None,
    _prior("--hand-eye", "FILE", "Pose of the camera on the hand, as tanteo calibrate hand-eye writes it."),
]
HandEyeSd = Annotated[
    Any,
    _prior(
        "--hand-eye-sd",
        "LENGTH,ANGLE",
        "Standard deviations of that pose about each axis, as 1mm,0.2deg; those of the file if not given.",
    ),
    Words(partial(typed.pose_sds, "--hand-eye-sd")),
]
DetectionsPath = Annotated[
    str | None,
    _prior("--detections", "FILE", "Poses of a detector with scores as a second opinion (JSON, Detection3DArray)."),
]
NoTable = Annotated[
    bool, _prior("--no-table", None, "The object in the images may have any pose: it lies on no table.")
]

Significance = Annotated[
    float,
    _answer("--significance", None, "Significance level of all tests: probability of a false rejection."),
    Words(partial(typed.fraction, "--significance", "number", str(SIGNIFICANCE)), float),
]
Top = Annotated[
    int,
    _answer("--top", None, "Print at most this many hypotheses."),
    Words(partial(typed.at_least, "--top", 1, f"Use {TOP}"), int),
]
Count = Annotated[
    int | None,
    _answer(
        "--count",
        None,
        "Number of equal parts that the readings are of; without it, several are found if one fits too few.",
    ),
    Words(partial(typed.at_least, "--count", 1, "Use 2"), int),
]
AsPublished = Annotated[bool, _answer("--as-published", None, "Use the equations as the paper of 1991 prints them.")]
Seed = Annotated[int, _answer("--seed", None, "Seed of the search: the same seed gives the same answer."), SEED]

Report = Annotated[str | None, _output("--report", "FILE.html", "Write a report that any browser opens, offline.")]
DetectionsTarget = Annotated[
    str | None,
    _output("--write-detections", "FILE.json", "Write hypotheses and poses as a Detection3DArray (see --detections)."),
]
Json = Annotated[bool, _output("--json", None, "Print one JSON document and nothing else.")]
Verbose = Annotated[bool, _output("--verbose -v", None, "Print more details.")]

SceneFile = Annotated[str, option("--scene", "FILE", "Scene: parts, table, hand (TOML).")]
Standoff = Annotated[
    float | None,
    option("--standoff", "LENGTH", "Distance of the hand's front from the surface, as 20mm; the scene's if not given."),
    STANDOFF,
]
ImageFile = Annotated[
    str | None,
    _image("--image", "IMAGE", "Start from this image of the table; the value render draws one of the scene."),
]
CameraFile = Annotated[
    str | None, _image("--camera", "FILE", "Calibration file of the camera; the scene's if not given.")
]
MarksFile = Annotated[
    str | None,
    _image("--marks", "FILE", "Known points of the table and their pixels in the image, to place the camera (CSV)."),
]
Need = Annotated[
    float | None,
    _answer("--need", "LENGTH", "Needed accuracy of the part's farthest corner (95 %), as 0.5mm; else exit code 3."),
    Words(partial(typed.spread, "--need", True)),
]
Goal = Annotated[
    float | None,
    sensing("--goal", "LENGTH", "Largest error of the part's corners, or of --feature, as 0.5mm."),
    Words(partial(typed.spread, "--goal", True)),
]
Confidence = Annotated[
    float,
    sensing("--confidence", None, "Probability that the goal holds."),
    Words(partial(typed.fraction, "--confidence", "probability", "0.95"), float),
]
Feature = Annotated[
    str | None,
    sensing("--feature", "NAME", "Feature to place instead of all corners: 'face 3', 'edge 4' or 'vertex 2'."),
]
SceneSeed = Annotated[
    int | None,
    sensing("--seed", None, "Seed of all simulated errors; the scene's if not given."),
    Words(_seed, int | None),
]
