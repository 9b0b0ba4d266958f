"""The options that commands share, in the groups that ``--help`` shows. Only the parser is imported here."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

_readings = partial(typer.Option, rich_help_panel="Readings and parts")
_errors = partial(typer.Option, rich_help_panel="Errors")
_prior = partial(typer.Option, rich_help_panel="Prior knowledge")
_image = partial(typer.Option, rich_help_panel="Image")
_sensing = partial(typer.Option, rich_help_panel="Sensing")
_answer = partial(typer.Option, rich_help_panel="Answer")
_output = partial(typer.Option, rich_help_panel="Output")


class Grouped(TyperCommand):
    """A command whose help has its options in groups."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Arguments first, then each group in the order of its first option."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                argument = parameter.param_type_name == "argument"
                name = "Arguments" if argument else getattr(parameter, "rich_help_panel", None) or "Options"
                groups.setdefault(name, []).append(record)
        for name, records in groups.items():
            with formatter.section(name):
                formatter.write_dl(records)


def sensor_names(incomplete: str) -> list[str]:
    """Presets of sensors that begin so."""
    from tanteo.sensors import sensor_presets

    return [name for name in sensor_presets() if name.startswith(incomplete)]


def robot_names(incomplete: str) -> list[str]:
    """Presets of robots that begin so."""
    from tanteo.sensors import robot_presets

    return [name for name in robot_presets() if name.startswith(incomplete)]


def preset_names(incomplete: str) -> list[str]:
    """Presets of sensors and of robots that begin so."""
    return [*sensor_names(incomplete), *robot_names(incomplete)]


def policy_names(incomplete: str) -> list[str]:
    """Policies that begin so."""
    from tanteo.active import POLICIES

    return [name for name in POLICIES if name.startswith(incomplete)]


_UNIT = "Unit of STL, OBJ, PLY and OFF: mm, cm, m, um, in, ft."
ReadingsPath = Annotated[str, typer.Argument(metavar="READINGS", help="Readings file (CSV).")]
PartPaths = Annotated[
    list[str], _readings("--parts", metavar="FILE_OR_FOLDER...", help="CAD files (STEP, STL) or folders of them.")
]
PartPath = Annotated[str, _readings("--part", metavar="FILE", help="CAD file of the part (STEP, STL, ...).")]
Units = Annotated[str | None, _readings("--units", metavar="UNIT", help=_UNIT)]
RigPath = Annotated[
    str | None, _readings("--rig", metavar="FILE", help="Where the range sensors sit on the hand (TOML).")
]

Sensor = Annotated[
    str | None,
    _errors("--sensor", metavar="NAME", help="Preset with the sensor's errors.", autocompletion=sensor_names),
]
Sd = Annotated[
    str | None, _errors("--sd", metavar="LENGTH", help="Standard deviation of readings without their own, as 0.3mm.")
]
Tolerance = Annotated[
    str, _errors("--tolerance", metavar="LENGTH", help="Standard deviation of the made part from its CAD, as 0.1mm.")
]
Robot = Annotated[
    str | None,
    _errors("--robot", metavar="PRESET", help="Preset with the robot's errors.", autocompletion=robot_names),
]
TipSd = Annotated[
    str | None,
    _errors("--tip-sd", metavar="X,Y,Z", help="Standard deviations of the tip's offset in the hand, as 1.5,1.5,0.3mm."),
]

TableAt = Annotated[
    str | None, _prior("--table", metavar="HEIGHT", help="The part rests on a level table at this height, as 0+-1mm.")
]
BoxAt = Annotated[
    str | None,
    _prior("--box", metavar="LOW,HIGH", help="The part is in this box of the world, as 0,0,0,500,400,200mm."),
]
PosePriorAt = Annotated[
    str | None,
    _prior("--pose-prior", metavar="POSE", help="The part is near this pose, as '400,200,0mm 0,0,90deg +- 5mm 3deg'."),
]
PriorPath = Annotated[
    str | None, _prior("--prior", metavar="FILE", help="Table, box and pose prior from a file (TOML).")
]
OutlierRate = Annotated[
    str | None, _prior("--outlier-rate", metavar="SHARE", help="Expected outlier fraction, as 10%; 2% if not given.")
]
UnknownPrior = Annotated[
    str | None,
    _prior(
        "--unknown-prior",
        metavar="SHARE",
        help="Prior probability that the object is unknown, as 0.1%; 5% if not given.",
    ),
]

Significance = Annotated[float, _answer("--significance", help="Significance level of the tests.")]
Top = Annotated[int, _answer("--top", help="How many hypotheses to report.")]
AsPublished = Annotated[bool, _answer("--as-published", help="Use the equations as the paper of 1991 prints them.")]
Seed = Annotated[int, _answer("--seed", help="Seed of the search: the same seed gives the same answer.")]

ImageFile = Annotated[
    str | None,
    _image("--image", metavar="IMAGE", help="Start from an image of the table; render: of the scene itself."),
]
CameraFile = Annotated[
    str | None, _image("--camera", metavar="FILE", help="Its calibration (YAML, JSON); else the scene's.")
]
MarksFile = Annotated[
    str | None, _image("--marks", metavar="FILE", help="Known points of the table, to place the camera (CSV).")
]

PolicyName = Annotated[
    str, _sensing("--policy", metavar="NAME", help="How the next reading is chosen.", autocompletion=policy_names)
]
Probability = Annotated[float, _sensing("--probability", help="Probability of the part at which to stop.")]
Within = Annotated[
    str | None, _sensing("--tolerance", metavar="LENGTH", help="Go on until all corners are placed within it, as 2mm.")
]
Feature = Annotated[
    str | None,
    _sensing("--feature", metavar="NAME", help="Place this instead of the corners: 'face 3', 'edge 4' or 'vertex 2'."),
]
Confidence = Annotated[float, _sensing("--confidence", help="Probability with which the tolerance has to hold.")]
MaxMeasurements = Annotated[int, _sensing("--max-measurements", help="Readings after which to stop in any case.")]
SceneSeed = Annotated[int | None, _sensing("--seed", help="Seed of all simulated errors; else the scene's.")]

Report = Annotated[
    str | None, _output("--report", metavar="FILE.html", help="Write a report that any browser opens, offline.")
]
Json = Annotated[bool, _output("--json", help="Print one JSON document and nothing else.")]
Verbose = Annotated[bool, _output("--verbose", "-v", help="Say more.")]
