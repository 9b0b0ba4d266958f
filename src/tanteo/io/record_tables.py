"""The tables of a session's record (``docs/formats.md``)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tanteo.active import Probe, Stop
from tanteo.answers import Priors
from tanteo.defaults import SIGNIFICANCE
from tanteo.io.document import made, table, value
from tanteo.io.part_files import PartFile
from tanteo.io.schema import Place, Table, as_plain
from tanteo.sensors import Readings, Rig, RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.session import Action, Observation, Sensing
from tanteo.typing import Covariances, FloatArray, IntArray, Transforms

HERE = Place("record")


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
        return cls(at=HERE, asked=one.action, readings=said or None, note=one.note)

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
    bias_sd: float | None = None

    @classmethod
    def of(cls, sensing: Sensing) -> SensingTable:
        """The table of what a session has."""
        sensor, robot, tip_sd = sensing.sensor, sensing.robot, sensing.tip_sd
        return cls(
            at=HERE,
            sensor=sensor_preset(sensor) if isinstance(sensor, str) else sensor,
            robot=robot_preset(robot) if isinstance(robot, str) else robot,
            sd=sensing.sd,
            tip_sd=None if tip_sd is None else np.asarray(tip_sd, dtype=np.float64),
            rig=sensing.rig,
            tolerance=sensing.tolerance,
            bias_sd=sensing.bias_sd,
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
        significance: significance level of the tests of an answer; left out where it is the usual one.
        seen: the images from which the session starts (``image_record.py``); left out where there are none.
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
    significance: float = SIGNIFICANCE
    seen: object = None

    @property
    def source(self) -> str:
        """The file."""
        return self.at.file


def _says(column: Any) -> bool:
    """Whether a column has anything in it."""
    cells = np.asarray(column, dtype=object).ravel()
    return any(cell not in ("nan", "", False) for cell in cells)
