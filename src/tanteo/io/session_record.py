"""A session as a record file (JSON, ``tanteo.session/1``), and the same session from it (``docs/formats.md``)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tanteo import __version__
from tanteo.active import POLICIES, Candidates, Policy, Probe, SensingState, Start, Stop
from tanteo.answers import Priors
from tanteo.errors import InputError
from tanteo.inference import PreparedPart, prepare_all
from tanteo.io.document import as_plain, load_json, made, table, value
from tanteo.io.part_files import PartFile, part_file, parts_of
from tanteo.io.result_json import recognition_document
from tanteo.io.schema import Place, Table
from tanteo.parts import Part
from tanteo.replaced import replaced
from tanteo.sensors import Readings, Rig, RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.session import Action, Observation, Sensing, Session
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms

SCHEMA = "tanteo.session/1"

_HERE = Place("record")
_POLICIES: dict[str, Any] = {type(policy).__name__: type(policy) for policy in POLICIES.values()}


@dataclass(frozen=True, slots=True, eq=False)
class PosePriors:
    """A :class:`~tanteo.active.Start` without its parts; the same fields."""

    part: IntArray
    Ts: Transforms
    covariances: Covariances
    weights: FloatArray
    priors: Priors


class ObservationTable(Table, frozen=True, kw_only=True, eq=False):
    """What was told at once; of the readings, the columns that say something."""

    asked: Action | None
    readings: object
    note: str

    @classmethod
    def of(cls, one: Observation) -> ObservationTable:
        """The table of an observation."""
        columns = {} if one.readings is None else as_plain(one.readings)
        said = {name: column for name, column in columns.items() if name == "ids" or _says(column)}
        return cls(at=_HERE, asked=one.action, readings=said or None, note=one.note)

    def observation(self) -> Observation:
        """What was told; a column that is missing says nothing."""
        return Observation(self.asked, self._readings(), self.note)

    def _readings(self) -> Readings | None:
        raw, place = self.readings, self.at.inside("readings")
        if not isinstance(raw, dict):
            if raw is None:
                return None
            raise self.at.refused("readings", "a table of columns or null")
        ids = value(tuple[str, ...], raw.get("ids"), replace(place, table=raw), "ids")
        blank = made(Readings.from_columns, {"points": np.zeros((len(ids), 3))}, str(place))
        columns = {f.name: getattr(blank, f.name) for f in fields(Readings)}
        return table(Readings, raw, place, columns | {"points": np.full_like(blank.points, np.nan)})


class SensingTable(Table, frozen=True, kw_only=True, eq=False):
    """How readings are made into measurements; the values of presets stand here: a record outlives a change of them."""

    sensor: SensorPreset | None
    robot: RobotPreset | None
    sd: float | None
    tip_sd: FloatArray | None
    rig: Rig | None
    tolerance: float

    @classmethod
    def of(cls, sensing: Sensing) -> SensingTable:
        """The table of what a session has."""
        sensor, robot, tip_sd = sensing.sensor, sensing.robot, sensing.tip_sd
        return cls(
            at=_HERE,
            sensor=sensor_preset(sensor) if isinstance(sensor, str) else sensor,
            robot=robot_preset(robot) if isinstance(robot, str) else robot,
            sd=sensing.sd,
            tip_sd=None if tip_sd is None else np.asarray(tip_sd, dtype=np.float64),
            rig=sensing.rig,
            tolerance=sensing.tolerance,
        )


class SessionRecord(Table, frozen=True, kw_only=True, eq=False):
    """All that a session needs to be what it was.

    Attributes:
        schema: of the document.
        version: of tanteo that wrote it.
        parts: their files.
        start: what was assumed beforehand.
        probe: what senses.
        sensing: how readings are made into measurements.
        policy: which reading is chosen: its kind, and its options.
        stop: when to end.
        seed: of everything that draws.
        observations: what was observed, in order.
        asked: the question that waited for its answer.
        refused: the questions that could not be answered.
        questions: the largest number of a question until then.
        answer: the answer then, a document ``tanteo.recognition/1``.
    """

    schema: str
    version: str
    parts: tuple[PartFile, ...]
    start: PosePriors
    probe: Probe
    sensing: SensingTable
    policy: object
    stop: Stop
    seed: Annotated[int, Meta(ge=0)]
    observations: tuple[ObservationTable, ...]
    asked: Action | None
    refused: tuple[Action, ...]
    questions: int
    answer: Annotated[dict[str, Any], Meta(description="a table")]

    @property
    def source(self) -> str:
        """The file."""
        return self.at.file


def write_record(session: Session, path: str | Path) -> None:
    """Write all of a session to a file, which is replaced whole or not at all.

    Raises:
        InputError: the session's policy is none of those that can be named.
        OSError: the file cannot be written.
    """
    text = json.dumps(session_document(session), allow_nan=False, separators=(",", ":"))
    with replaced(path) as file:
        file.write_text(text + "\n", encoding="utf-8")


def session_document(session: Session) -> dict[str, Any]:
    """All of a session as plain dictionaries, lists, texts and numbers."""
    start, policy = session.start, session.policy
    kind = type(policy).__name__
    if type(policy) is not _POLICIES.get(kind):
        raise InputError(f"policy: expected one of {', '.join(POLICIES)}, got {kind}. A record can hold only these.")
    record = SessionRecord(
        at=_HERE,
        schema=SCHEMA,
        version=__version__,
        parts=tuple(part_file(target.part) for target in start.targets),
        start=PosePriors(start.part, start.Ts, start.covariances, start.weights, start.priors),
        probe=session.probe,
        sensing=SensingTable.of(session.sensing),
        policy={"kind": kind, **as_plain(policy)},
        stop=session.stop,
        seed=int(session.seed),
        observations=tuple(map(ObservationTable.of, session.observations)),
        asked=session.asked,
        refused=tuple(session.refused),
        questions=int(session.questions),
        answer=recognition_document(session.answer()),
    )
    return dict(as_plain(record))


def load_record(path: str | Path) -> SessionRecord:
    """What a record file says; no part is read.

    Raises:
        InputError: the file cannot be read, or is not a whole record; the message names file and key.
    """
    record = load_json(Path(path), "session", SessionRecord, SCHEMA, "Take the record as it was written.")
    _policy(record)
    observations = [one.observation() for one in record.observations]
    actions = [*(one.action for one in observations), record.asked, *record.refused]
    least = max((action.number for action in actions if action), default=0)
    if record.questions < least:
        raise record.at.refused("questions", f"{least} or more, the largest number of a question", "Correct it.")
    return record


def _policy(record: SessionRecord) -> Policy:
    """Which reading is chosen."""
    raw = record.policy
    kind = _POLICIES.get(str(raw.get("kind"))) if isinstance(raw, dict) else None
    if not isinstance(raw, dict) or kind is None:
        raise record.at.refused("policy", f"'kind' to be one of {', '.join(_POLICIES)}")
    options = {name: option for name, option in raw.items() if name != "kind"}
    policy: Policy = table(kind, options, record.at.inside("policy"))
    return policy


def _says(column: Any) -> bool:
    """Whether a column has anything in it."""
    cells = np.asarray(column, dtype=object).ravel()
    return any(cell not in ("nan", "", False) for cell in cells)


def resumed(
    record: SessionRecord,
    parts: Sequence[Part | PreparedPart],
    progress: Callable[[int, int], None] | None = None,
    able: Callable[[SensingState, Candidates], BoolArray] | None = None,
) -> Session:
    """The session of a record: given all of them again, it has the same belief and asks the same next.

    Args:
        record: of the session.
        parts: those of :func:`tanteo.io.part_files.parts_of`, or the same prepared.
        progress: called with (tells done, tells in all) before each.
        able: which candidates can be made, see :attr:`~tanteo.session.Session.able`: a hand is not in the record, and
            without it, what it cannot make may be asked for.

    Raises:
        InputError: what the record says together cannot be.
    """
    rough = record.start
    values = {name: getattr(rough, name) for name in PosePriors.__slots__}
    targets = prepare_all("parts", parts)
    start = made(Start, {"targets": targets, **values}, f"{record.source}, start")
    sensing = Sensing(**record.sensing.values())
    session = Session(start, record.probe, sensing, _policy(record), record.stop, record.seed, able)

    def observations() -> Iterator[Observation]:
        for k, one in enumerate(record.observations):
            if progress is not None:
                progress(k, len(record.observations))
            yield one.observation()

    try:
        session.resume(observations(), record.asked, record.refused, record.questions)
    except InputError as error:
        raise InputError(f"{record.source}, observations[{len(session.steps)}]: {error}") from None
    return session


def read_record(
    path: str | Path,
    parts: Sequence[Part | PreparedPart] | None = None,
    able: Callable[[SensingState, Candidates], BoolArray] | None = None,
) -> Session:
    """The session of a record file, at the point where it was written: ask and tell on.

    Args:
        path: of the record.
        parts: of the session, loaded again, in any order; read from their files if not given.
        able: which candidates can be made, see :func:`resumed`.

    Raises:
        InputError: the record or a part is not what it was; the message says which and what to do.
    """
    record = load_record(path)
    return resumed(record, parts_of(record.parts, record.source, parts), able=able)
