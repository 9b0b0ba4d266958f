"""The options of the commands: each is declared once, with its group in ``--help`` and how its words are read.

Only the parser is imported here. What an option's words mean is read before any file is touched: SI units inside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tanteo import answers, io
from tanteo.cli.printing import complain
from tanteo.errors import InputError, ReadingsError, TanteoError

if TYPE_CHECKING:
    from tanteo.active import Stop
    from tanteo.answers import PosePrior, Table
    from tanteo.frames import UncertainFrame
    from tanteo.io import Brand
    from tanteo.typing import FloatArray
else:  # the parser resolves annotations, and has to load nothing for that
    FloatArray = Table = UncertainFrame = Any

_MESSAGES = {
    "sd": "--sd", "tolerance": "--tolerance", "tip_sd": "--tip-sd", "sensor": "--sensor", "robot": "--robot",
    "as_published": "--as-published", "priors, outlier_rate": "--outlier-rate", "priors, unknown": "--unknown-prior",
    "bias_sd": "--bias-sd", "mass": "--mass", "size": "--size", "scheduler": "--scheduler",
    "priors, noise_factor": "--noise-factor", "table, sd": "--table", "prior, box": "--box",
    "prior, T_world_part": "--pose-prior", "prior, covariance": "--pose-prior", "feature": "--feature",
}  # fmt: skip
"""Names in messages of what an option says, and the option."""


class MisuseError(TanteoError):
    """The command was called wrongly: exit code 2."""


@contextmanager
def misuse(*, always: bool = True) -> Iterator[None]:
    """Errors inside are the caller's options.

    Args:
        always: Unless they are the readings'; else only those whose message begins with an option.
    """
    try:
        yield
    except ReadingsError:
        raise
    except TanteoError as error:
        name, _, rest = str(error).partition(": ")
        if name in _MESSAGES:
            raise MisuseError(f"{_MESSAGES[name]}: {rest}") from None
        if always:
            raise MisuseError(str(error)) from None
        raise


@dataclass(frozen=True, slots=True)
class Words:
    """Beside an option: its value is read from what is typed, unless nothing is.

    Attributes:
        read: From what is typed to the value; raises InputError.
        typed: What the parser takes.
        default: As it would be typed.
    """

    read: Callable[[Any], Any]
    typed: Any = str | None
    default: str | None = None


def _preset(name: str) -> str:
    from tanteo.sensors import sensor_preset

    sensor_preset(name)
    return name


def _robot(name: str) -> str:
    from tanteo.sensors import robot_preset

    robot_preset(name)
    return name


def _policy(name: str) -> str:
    from tanteo.active import policy_named

    policy_named(name)
    return name


def _unit(name: str) -> str:
    from tanteo.parts import unit_name

    return unit_name(name)


def length(name: str, example: str, text: str) -> float:
    """A positive length [m]."""
    value = io.parse_length(text, name)
    if not value > 0:
        raise InputError(f"{name}: expected a positive length, got '{text}'. Write it as {example}.")
    return value


def _spread(name: str, positive: bool, text: str) -> float:
    """A standard deviation that readings or parts can have [m]."""
    from tanteo.limits import LARGEST, LEAST_SD

    value = io.parse_length(text, name)
    if not math.isfinite(value) or value < 0 or (positive and value == 0):
        expected = "a positive length" if positive else "a length of zero or more"
        raise InputError(f"{name}: expected {expected}, got '{text}'. Write it as 0.3mm.")
    if value > LARGEST or (positive and value < LEAST_SD):
        least = f"from {LEAST_SD:g} " if positive else ""
        raise InputError(f"{name}: expected a length {least}up to {LARGEST:g} m, got '{text}'. Check its unit.")
    return value


def _tip(text: str) -> tuple[float, ...]:
    from tanteo.limits import LARGEST

    values = io.parse_lengths(text, "--tip-sd")
    if len(values) != 3 or min(values) < 0 or max(values) == 0:
        raise InputError(
            f"--tip-sd: expected three lengths of zero or more (x, y, z of the hand), got '{text}'. "
            "Write it as 1.5,1.5,0.3mm."
        )
    if max(values) > LARGEST:
        raise InputError(f"--tip-sd: expected lengths up to {LARGEST:g} m, got '{text}'. Check their unit.")
    return values


def _standoff(text: str) -> float:
    value = io.parse_length(text, "--standoff")
    if not 1e-3 <= value <= 1:
        raise InputError(f"--standoff: expected a length of 1 mm to 1 m, got '{text}'. Write it as 20mm.")
    return value


def _share(name: str, largest: float, word: str, text: str) -> float:
    """A share between 0 and the largest that it may be, which has that name, as ``10%`` or ``0.1``."""
    try:
        value = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < largest:
        raise InputError(f"{name}: expected a share above 0 and below {word}, got '{text}'. Write it as 5%.")
    return value


def fraction(name: str, what: str, example: str, value: float) -> float:
    """A number between 0 and 1."""
    if not 0 < value < 1:
        raise InputError(f"{name}: expected a {what} between 0 and 1, got {value:g}. Use {example}.")
    return value


def at_least(name: str, least: int, advice: str, value: int) -> int:
    """A number that is not less."""
    if value < least:
        raise InputError(f"{name}: expected {least} or more, got {value}. {advice}.")
    return value


def _pose(text: str) -> Any:
    frame = io.parse_pose_prior(text, "--pose-prior")
    _warn_if_unverified("--pose-prior", io.BRANDS.get(text.split(maxsplit=1)[0].rstrip(":")))
    return frame


def _warn_if_unverified(place: str, brand: Brand | None) -> None:
    """Warn of a brand whose convention nobody has read in its documentation."""
    if brand is not None and not brand.verified:
        complain(
            "warning",
            f"{place}: the angle convention of {brand.name} ({' '.join(brand.fields)}) was not checked against its "
            "documentation. Compare one pose with the answer, or give roll, pitch, yaw.",
        )


def sensor_names(incomplete: str) -> list[str]:
    """Presets of sensors that begin so."""
    from tanteo.sensors import sensor_presets

    return [name for name in sensor_presets() if name.startswith(incomplete)]


def robot_names(incomplete: str) -> list[str]:
    """Presets of robots that begin so."""
    from tanteo.sensors import robot_presets

    return [name for name in robot_presets() if name.startswith(incomplete)]


def _policy_names(incomplete: str) -> list[str]:
    from tanteo.active import POLICIES

    return [name for name in POLICIES if name.startswith(incomplete)]


def option(names: str, metavar: str | None, words: str, **more: Any) -> Any:
    """An option as the parser wants it: names with blanks between them, and what ``--help`` says of it."""
    return typer.Option(*names.split(), metavar=metavar, help=words, **more)


_readings = partial(option, rich_help_panel="Readings and parts")
_errors = partial(option, rich_help_panel="Errors")
_prior = partial(option, rich_help_panel="Prior knowledge")
_image = partial(option, rich_help_panel="Image")
_sensing = partial(option, rich_help_panel="Sensing")
_answer = partial(option, rich_help_panel="Answer")
_output = partial(option, rich_help_panel="Output")

SENSOR_HELP, ROBOT_HELP = "Preset with the sensor's errors.", "Preset with the robot's errors."
UNITS_HELP = "Unit of files without one (logs, clouds, STL, OBJ, OFF): mm, m, um, in; of parts cm, ft too."
_seed = partial(at_least, "--seed", 0, "Use 0")
SEED, UNIT, PRESET, ROBOT, STANDOFF = Words(_seed, int), Words(_unit), Words(_preset), Words(_robot), Words(_standoff)

ReadingsPath = Annotated[str, typer.Argument(metavar="READINGS", help="File of readings: CSV, probe log, cloud, ...")]
PartPaths = Annotated[
    list[str], _readings("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL), folders of them, or a catalogue.")
]
PartPath = Annotated[str, _readings("--part", "FILE", "CAD file of the part (STEP, STL, ...).")]
Units = Annotated[str | None, _readings("--units", "UNIT", UNITS_HELP), UNIT]
RigPath = Annotated[str | None, _readings("--rig", "FILE", "Where the range sensors sit on the hand (TOML).")]

Sensor = Annotated[str | None, _errors("--sensor", "NAME", SENSOR_HELP, autocompletion=sensor_names), PRESET]
Sd = Annotated[
    float | None,
    _errors("--sd", "LENGTH", "Standard deviation of readings without their own, as 0.3mm."),
    Words(partial(_spread, "--sd", True)),
]
Tolerance = Annotated[
    float,
    _errors("--tolerance", "LENGTH", "Standard deviation of the made part from its CAD, as 0.1mm."),
    Words(partial(_spread, "--tolerance", False), str, "0mm"),
]
Robot = Annotated[str | None, _errors("--robot", "PRESET", ROBOT_HELP, autocompletion=robot_names), ROBOT]
TipSd = Annotated[
    tuple[float, ...] | None,
    _errors("--tip-sd", "X,Y,Z", "Standard deviations of the tip's offset in the hand, as 1.5,1.5,0.3mm."),
    Words(_tip),
]

BiasSd = Annotated[
    float | None,
    _errors("--bias-sd", "LENGTH", "Standard deviation of an offset along the approach that all readings share."),
    Words(partial(_spread, "--bias-sd", True)),
]
NoiseFactor = Annotated[
    float | None,
    _errors(
        "--noise-factor", "FACTOR", "The noise is known to this factor; 1: as stated; 2 if not given, 1.5 of presets."
    ),
]

FurniturePaths = Annotated[
    list[str] | None,
    _prior("--furniture", "FILE@POSE+-SD", "What stands around, as 'vise.stl@400,200,0mm 0,0,90deg +- 0.5mm'."),
]
TableAt = Annotated[
    Table | None,
    _prior("--table", "HEIGHT", "The part rests on a level table at this height, as 0+-1mm."),
    Words(lambda text: io.parse_table(text, "--table")),
]
BoxAt = Annotated[
    FloatArray | None,
    _prior("--box", "LOW,HIGH", "The part is in this box of the world, as 0,0,0,500,400,200mm."),
    Words(lambda text: io.parse_box(text, "--box")),
]
PosePriorAt = Annotated[
    UncertainFrame | None,
    _prior("--pose-prior", "POSE", "The part is near this pose, as '400,200,0mm 0,0,90deg +- 5mm 3deg'."),
    Words(_pose),
]
PriorPath = Annotated[str | None, _prior("--prior", "FILE", "Table, box and pose prior from a file (TOML).")]
OutlierRate = Annotated[
    float | None,
    _prior("--outlier-rate", "SHARE", "Expected outlier fraction, as 10%; 1% if not given."),
    Words(partial(_share, "--outlier-rate", 0.5, "one half")),
]
UnknownPrior = Annotated[
    float | None,
    _prior("--unknown-prior", "SHARE", "Prior probability that the object is unknown, as 0.1%; 5% if not given."),
    Words(partial(_share, "--unknown-prior", 1.0, "one")),
]

Mass = Annotated[
    tuple[float, float] | None,
    _prior("--mass", "MASS", "The object was weighed, as 340g+-2g; needs --density."),
    Words(lambda text: io.parse_mass(text, "--mass")),
]
Density = Annotated[
    tuple[float, float] | None,
    _prior("--density", "DENSITY", "Of the material, as 7.85g/cm3+-1%."),
    Words(lambda text: io.parse_density(text, "--density")),
]
Size = Annotated[
    Any,
    _prior("--size", "A,B,C", "Sides of a box about the object, in any order, as 120,80,50mm+-1mm."),
    Words(lambda text: io.parse_size(text, "--size")),
]

ImagePath = Annotated[
    str | None,
    _prior("--image", "FILE", "Image of the object on a table: its outline narrows the parts. Needs --camera."),
]
CameraPath = Annotated[
    str | None, _prior("--camera", "FILE", "Calibration of the camera of --image, placed in the world or by --marks.")
]
MarksPath = Annotated[
    str | None, _prior("--marks", "FILE", "Known points of the table in --image, to place the camera (CSV).")
]

Significance = Annotated[
    float,
    _answer("--significance", None, "Significance level of the tests."),
    Words(partial(fraction, "--significance", "number", "0.01"), float),
]
Top = Annotated[
    int, _answer("--top", None, "How many hypotheses to report."), Words(partial(at_least, "--top", 1, "Use 5"), int)
]
AsPublished = Annotated[bool, _answer("--as-published", None, "Use the equations as the paper of 1991 prints them.")]
Seed = Annotated[int, _answer("--seed", None, "Seed of the search: the same seed gives the same answer."), SEED]

Report = Annotated[str | None, _output("--report", "FILE.html", "Write a report that any browser opens, offline.")]
Json = Annotated[bool, _output("--json", None, "Print one JSON document and nothing else.")]
Verbose = Annotated[bool, _output("--verbose -v", None, "Say more.")]

SceneFile = Annotated[str, option("--scene", "FILE", "Scene: parts, table, hand (TOML).")]
Standoff = Annotated[
    float | None, option("--standoff", "LENGTH", "Of the hand's front, as 20mm; else the scene's."), STANDOFF
]
ImageFile = Annotated[
    str | None, _image("--image", "IMAGE", "Start from an image of the table; render: of the scene itself.")
]
CameraFile = Annotated[str | None, _image("--camera", "FILE", "Its calibration (YAML, JSON); else the scene's.")]
MarksFile = Annotated[str | None, _image("--marks", "FILE", "Known points of the table, to place the camera (CSV).")]
Feature = Annotated[
    str | None, _sensing("--feature", "NAME", "Place this instead of the corners: 'face 3', 'edge 4' or 'vertex 2'.")
]
SceneSeed = Annotated[
    int | None, _sensing("--seed", None, "Seed of all simulated errors; else the scene's."), Words(_seed, int | None)
]


def read_known(
    table: Table | None, box: FloatArray | None, pose_prior: UncertainFrame | None, file: str | None
) -> PosePrior | None:
    """What ``--table``, ``--box``, ``--pose-prior`` and ``--prior`` say together; None if none is given.

    Raises:
        MisuseError: An option says again what the file says.
        InputError: The file cannot be read.
    """
    if all(value is None for value in (table, box, pose_prior, file)):
        return None
    given: dict[str, Any] = {"table": table, "box": box}
    if pose_prior is not None:
        given |= {"T_world_part": pose_prior.T, "covariance": pose_prior.C}
    given = {name: value for name, value in given.items() if value is not None}
    with misuse():
        said = answers.PosePrior(**given)
    if file is None:
        return said
    read = io.read_prior(file)
    _warn_if_unverified(f"{file}, near", io.prior_brand(file))
    options = {"table": "--table", "box": "--box", "T_world_part": "--pose-prior", "covariance": "--pose-prior"}
    for name in given:
        if getattr(read, name) is not None:
            raise MisuseError(f"{options[name]}: expected it once, got it in {file} too. Keep one.")
    return replace(read, **given)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions:
    """Options of a session in a scene: how to choose, when to end, what is known, and an image to start from."""

    policy: Annotated[
        str,
        _sensing("--policy", "NAME", "How the next reading is chosen.", autocompletion=_policy_names),
        Words(_policy, str),
    ] = "information"
    probability: Annotated[
        float,
        _sensing("--probability", None, "Probability of the part at which to stop."),
        Words(partial(fraction, "--probability", "probability", "0.99"), float),
    ] = 0.99
    tolerance: Annotated[
        float | None,
        _sensing("--tolerance", "LENGTH", "Go on until all corners are placed within it, as 2mm."),
        Words(partial(length, "--tolerance", "2mm")),
    ] = None
    feature: Feature = None
    confidence: Annotated[
        float,
        _sensing("--confidence", None, "Probability with which the tolerance has to hold."),
        Words(partial(fraction, "--confidence", "probability", "0.99"), float),
    ] = 0.95
    max_measurements: Annotated[
        int,
        _sensing("--max-measurements", None, "Readings after which to stop in any case."),
        Words(partial(at_least, "--max-measurements", 1, "Use 100"), int),
    ] = 100
    standoff: Standoff = None
    units: Units = None
    pose_prior: PosePriorAt = None
    prior: PriorPath = None
    outlier_rate: OutlierRate = None
    unknown_prior: UnknownPrior = None
    image: ImageFile = None
    camera: CameraFile = None
    marks: MarksFile = None
    seed: SceneSeed = None

    def __post_init__(self) -> None:
        if self.feature is not None and self.tolerance is None:
            raise MisuseError(
                f"--feature: expected --tolerance with '{self.feature}', got none. Say --tolerance 0.5mm."
            )
        require_image(self.image, self.camera, self.marks)

    def known(self) -> PosePrior | None:
        """The prior pose; what says more than that raises MisuseError."""
        known = read_known(None, None, self.pose_prior, self.prior)
        if known is not None and (known.T_world_part is None or known.table is not None or known.box is not None):
            raise MisuseError(
                "--pose-prior, --prior: expected a prior pose and nothing else, got a table or a box. Say --pose-prior."
            )
        return known

    def stop(self) -> Stop:
        """When to end."""
        from tanteo.active import Stop

        return Stop(
            probability=self.probability, tolerance=self.tolerance, confidence=self.confidence,
            max_measurements=self.max_measurements, feature=self.feature,
        )  # fmt: skip


def require_image(image: str | None, camera: str | None, marks: str | None) -> None:
    """A camera is of no use without an image: raises MisuseError."""
    if image is None and (camera is not None or marks is not None):
        raise MisuseError("--camera, --marks: expected with --image, got none. Add --image FILE, or render.")
