"""Define the tables of a session record (``docs/formats_json.md``)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tanteo.defaults import SIGNIFICANCE
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.io.documents.document import made, table, value
from tanteo.io.documents.part_files import PartFile
from tanteo.io.documents.schema import Place, Table, as_plain
from tanteo.planning import Action, Observation, Probe, Sensing, Stop
from tanteo.posterior import Priors
from tanteo.sensors import Column, Readings, Rig
from tanteo.sensors.error_states import ERROR_STATES, ErrorState
from tanteo.sensors.presets import RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.words import Finding, message_of
from tanteo.words.findings import REASONS, Stated

HERE = Place("record")


@dataclass(frozen=True, slots=True, eq=False)
class PosePriors:
    """Fields of a :class:`~tanteo.planning.start.Start` without its parts.

    Attributes:
        part: index of the part of each prior pose ``(n,)``.
        Ts: prior poses ``T_world_part`` ``(n, 4, 4)`` [m].
        covariances: covariances of the poses ``(n, 6, 6)``.
        weights: prior probabilities of the poses ``(n,)``.
        priors: prior parameters of the recognition.
    """

    part: IntArray
    Ts: Transforms
    covariances: Covariances
    weights: FloatArray
    priors: Priors


class ActionTable(Table, frozen=True, kw_only=True, eq=False):
    """Table of an action; ``why`` has its reason as text, ``reason`` the kind and the values of the reason."""

    number: int
    origin: FloatArray
    direction: FloatArray
    max_range: float
    expected: float
    part: str
    face: str
    gain: float
    why: str
    radius: float = 0.0
    acquires: str = ""
    unlikely: bool = False
    reason: object = None

    @classmethod
    def of(cls, action: Action | None) -> ActionTable | None:
        """Return the table of an action; None for None.

        Args:
            action: action to store.
        """
        if action is None:
            return None
        names = [name for name in cls.__struct_fields__ if name not in ("at", "why", "reason")]
        reason = action.reason
        known = type(reason) in REASONS.values()
        stored = {"kind": reason.kind, "values": as_plain(reason)} if known else None
        values = {name: getattr(action, name) for name in names}
        return cls(at=HERE, why=action.reason.message, reason=stored, **values)

    def action(self) -> Action:
        """Return the action.

        Raises:
            InputError: the action is invalid, or its reason has other values than its kind.
        """
        values = {name: item for name, item in self.values().items() if name not in ("why", "reason")}
        return made(Action, {**values, "reason": self._reason()}, str(self.at))

    def _reason(self) -> Finding:
        raw = self.reason
        if raw is None:
            return Stated(self.why)
        if not isinstance(raw, dict) or raw.get("kind") not in REASONS:
            raise self.at.refused("reason", f"'kind' to be one of {', '.join(REASONS)}")
        return table(REASONS[raw["kind"]], raw.get("values"), self.at.inside("reason"))


class ObservationTable(Table, frozen=True, kw_only=True, eq=False):
    """Table of one observation; of the readings it stores only the columns that are not empty."""

    action: ActionTable | None
    readings: object
    note: str

    @classmethod
    def of(cls, one: Observation) -> ObservationTable:
        """Return the table of an observation.

        Args:
            one: observation to store.
        """
        columns = {} if one.readings is None else as_plain(one.readings)
        filled = {name: column for name, column in columns.items() if name == "ids" or _has_content(column)}
        note = message_of(one.findings)
        return cls(at=HERE, action=ActionTable.of(one.action), readings=filled or None, note=note)

    def observation(self) -> Observation:
        """Return the observation; missing columns of the readings get their defaults."""
        action = None if self.action is None else self.action.action()
        return Observation(action, self._readings(), (Stated(self.note),) if self.note else ())

    def _readings(self) -> Readings | None:
        raw = self.readings
        place = self.at.inside("readings")
        if not isinstance(raw, dict):
            if raw is None:
                return None
            raise self.at.refused("readings", "a table of columns or null")
        ids = value(tuple[str, ...], raw.get("ids"), replace(place, table=raw), "ids")
        blank = made(Readings.from_columns, {"points": np.zeros((len(ids), 3))}, str(place))
        columns = {f.name: getattr(blank, f.name) for f in fields(Readings)}
        return table(Readings, raw, place, columns | {"points": Column.empty(len(ids), (3,))})


class ErrorTable(Table, frozen=True, kw_only=True, eq=False):
    """Table of an error that readings share; ``axes``, ``length`` and ``uniform`` belong to some errors only."""

    name: str
    sd: float
    axes: str | None = None
    length: float | None = None
    uniform: bool | None = None

    @classmethod
    def of(cls, error: ErrorState) -> ErrorTable:
        """Return the table of an error.

        Args:
            error: error to store.
        """
        stored = [one.name for one in fields(error) if one.name in cls.__struct_fields__]
        return cls(at=HERE, name=error.name, **{name: getattr(error, name) for name in stored})

    def state(self) -> ErrorState:
        """Return the error.

        Raises:
            InputError: there is no such error.
        """
        if self.name not in ERROR_STATES:
            raise self.at.refused("name", f"one of {', '.join(ERROR_STATES)}")
        stated = {"axes": self.axes, "length": self.length, "uniform": self.uniform}
        more: dict[str, Any] = {name: value for name, value in stated.items() if value is not None}
        return made(ERROR_STATES[self.name], {"sd": self.sd, **more}, str(self.at))


class SensingTable(Table, frozen=True, kw_only=True, eq=False):
    """Table of the noise model; it stores the values of presets, so that later changes of a preset do not affect it."""

    sensor: SensorPreset | None
    robot: RobotPreset | None
    sd: float | None
    tip_sd: FloatArray | None
    rig: Rig | None
    tolerance: float
    bias_sd: float | None = None
    shared_errors: tuple[ErrorTable, ...] = ()

    @classmethod
    def of(cls, sensing: Sensing) -> SensingTable:
        """Return the table of a session's noise model.

        Args:
            sensing: noise model to store.
        """
        sensor = sensing.sensor
        robot = sensing.robot
        tip_sd = sensing.tip_sd
        return cls(
            at=HERE,
            sensor=sensor_preset(sensor) if isinstance(sensor, str) else sensor,
            robot=robot_preset(robot) if isinstance(robot, str) else robot,
            sd=sensing.sd,
            tip_sd=None if tip_sd is None else np.asarray(tip_sd, dtype=np.float64),
            rig=sensing.rig,
            tolerance=sensing.tolerance,
            bias_sd=sensing.bias_sd,
            shared_errors=tuple(map(ErrorTable.of, sensing.shared_errors)),
        )


class SessionRecord(Table, frozen=True, kw_only=True, eq=False):
    """Record that restores a session exactly.

    Attributes:
        schema: name and version of the document's format.
        version: version of tanteo that wrote the record.
        parts: origins of the candidate parts.
        start: prior poses of the parts.
        probe: sensor that takes the readings.
        sensing: noise model that turns readings into measurements.
        policy: kind and options of the policy that chooses the next reading.
        stop: stopping criterion.
        seed: seed of all random numbers.
        observations: observations in order.
        pending: action whose readings were awaited; None if there was none.
        refused: actions that could not be carried out.
        questions: largest number given to an action so far.
        answer: answer at that time, a document ``tanteo.recognition/1``.
        significance: significance level of the answer's tests; omitted in the file where it is the default.
        seen: images from which the session starts (``image_record.py``); omitted where there are none.
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
    pending: ActionTable | None
    refused: tuple[ActionTable, ...]
    questions: int
    answer: Annotated[dict[str, Any], Meta(description="a table")]
    significance: float = SIGNIFICANCE
    seen: object = None

    @property
    def source(self) -> str:
        """Path of the record's file."""
        return self.at.file


def _has_content(column: Any) -> bool:
    """Return whether a column has a cell that is not empty."""
    cells = np.asarray(column, dtype=object).ravel()
    return any(cell not in ("nan", "", False) for cell in cells)
