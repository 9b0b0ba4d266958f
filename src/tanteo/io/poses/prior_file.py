"""Read a pose prior from a TOML file (``docs/formats_errors.md``): a table, a box, a prior pose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np
from msgspec import Meta

from tanteo.errors import CovarianceError, InputError
from tanteo.geometry import UncertainFrame, from_ros_covariance
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.documents.document import load_toml
from tanteo.io.documents.schema import Covariance, Direction, Length, Numbers, Point, Posed
from tanteo.io.documents.schema import Table as FileTable
from tanteo.io.poses.poses import pose_from_brand
from tanteo.io.poses.prior_text import check_pose_prior, spread_pose
from tanteo.io.readings.brands import BRANDS, Brand
from tanteo.posterior import PosePrior, Table

_COVARIANCES = ("covariance_m_rad", "ros_covariance_m_rad")
_SDS = (
    ((), (3,)),
    lambda sds: np.atleast_1d(sds) if (sds > 0).all() else None,
    "one positive number or three",
)
LengthSds = Annotated[FloatArray, Numbers("length", *_SDS)]
AngleSds = Annotated[FloatArray, Numbers("angle", *_SDS)]


class TableTable(FileTable, frozen=True, kw_only=True, eq=False):
    """Support plane of the part: level at a height, or any plane."""

    top: Length | None = None
    point: Point | None = None
    normal: Direction | None = None
    sd: Annotated[Length, Meta(gt=0, description="a positive length")]

    def to_table(self) -> Table:
        """Return the support plane with its standard deviation."""
        if (self.top is None) == (self.point is None):
            raise self.at.error("expected top_mm or point_mm with normal, got both or none. Give one.")
        point = np.array([0.0, 0.0, self.top]) if self.point is None else self.point
        return Table(point, np.array([0.0, 0.0, 1.0]) if self.normal is None else self.normal, self.sd)


class RestTable(FileTable, frozen=True, kw_only=True, eq=False):
    """Plane of a fixture that the part touches."""

    point: Point
    normal: Direction
    sd: Annotated[Length, Meta(gt=0, description="a positive length")]

    def to_table(self) -> Table:
        """Return the plane with its standard deviation."""
        return Table(self.point, self.normal, self.sd)


class BoxTable(FileTable, frozen=True, kw_only=True, eq=False):
    """Box in the world that contains the part's origin."""

    low: Point
    high: Point

    def to_box(self) -> FloatArray:
        """Return the lowest and the highest corner of the box, world frame ``(2, 3)`` [m]."""
        if not np.all(self.high > self.low):
            raise self.at.refused("high", "low below high in x, y and z")
        return np.stack([self.low, self.high])


class _PoseTable(Posed, frozen=True, kw_only=True, eq=False):
    """Prior pose with its uncertainty, in tanteo's convention or in that of a robot brand."""

    sd: LengthSds | None = None
    turn_sd: AngleSds | None = None
    covariance_m_rad: Covariance | None = None
    ros_covariance_m_rad: Covariance | None = None

    def to_frame(self) -> UncertainFrame:
        """Return the prior pose with its covariance."""
        T = self._pose()
        place = str(self.at)
        covariances = self.at.has(*_COVARIANCES)
        given = ["sd_mm and turn_sd_deg"] * bool(self.at.has("sd", "turn_sd")) + covariances
        if len(given) != 1:
            raise self.at.error(
                "expected the uncertainty once, as sd_mm and turn_sd_deg or as one of "
                f"{', '.join(_COVARIANCES)}, got {' and '.join(given) or 'nothing'}. Give one of them."
            )
        if not covariances:
            if self.sd is None or self.turn_sd is None:
                missing = "sd_mm" if self.sd is None else "turn_sd_deg"
                raise self.at.error(f"expected '{missing}', got nothing. Add it.")
            return spread_pose(T, self.sd, self.turn_sd, place)
        C = getattr(self, given[0])
        try:
            frame = UncertainFrame(T, C) if given == ["covariance_m_rad"] else from_ros_covariance(T, C.ravel())
        except CovarianceError as error:
            raise InputError(f"{place}, {given[0]}: {error} Copy it without changes.") from None
        return check_pose_prior(frame, f"{place}, {given[0]}")

    def _pose(self) -> Transforms:
        brands = self.at.has(*BRANDS)
        own = bool(self.at.has("position", "turn", "quaternion_wxyz"))
        if len(brands) + own != 1:
            raise self.at.error(
                "expected one pose, as position_mm with turn_deg or quaternion_wxyz, or by the name of a brand "
                f"({', '.join(BRANDS)}), got {len(brands) + own}. Give one."
            )
        if not own:
            try:
                return pose_from_brand(brands[0], getattr(self, brands[0]))
            except InputError as error:
                raise InputError(f"{self.at}, {brands[0]}: {error}") from None
        if self.position is None or (self.turn is None and self.quaternion_wxyz is None):
            raise self.at.error("expected a position and an attitude, got one of them. Give both.")
        return self.pose()


if TYPE_CHECKING:
    PosePriorTable = _PoseTable
else:
    _FIELDS = [
        (b.name, Annotated[FloatArray, Numbers("plain", ((len(b.fields),),))] | None, None) for b in BRANDS.values()
    ]
    PosePriorTable = msgspec.defstruct(
        "PosePriorTable", _FIELDS, bases=(_PoseTable,), kw_only=True, frozen=True, eq=False
    )


class PriorFile(FileTable, frozen=True, kw_only=True, eq=False):
    """Content of a prior file: one or more of its tables."""

    table: TableTable | None = None
    rests: tuple[RestTable, ...] = ()
    box: BoxTable | None = None
    pose_prior: PosePriorTable | None = None


def read_prior(path: str | Path) -> PosePrior:
    """Read a pose prior from a TOML file.

    Args:
        path: file with one or more of the tables ``[table]``, ``[[rests]]``, ``[box]`` and ``[pose_prior]``.

    Raises:
        InputError: the file cannot be read, is not TOML, or contains an invalid prior; the message names file, table,
            key and value.
        UnitError: a unit in a key is missing or unknown.

    Example:
        >>> prior = tanteo.read_prior("scenes/feeder.toml")
        >>> prior.T_world_part.shape
        (4, 4)
    """
    file = _load(path)
    if not file.at.written:
        raise file.at.error("expected a table [table], [[rests]], [box] or [pose_prior], got an empty file. Add one.")
    prior = None if file.pose_prior is None else file.pose_prior.to_frame()
    return PosePrior(
        T_world_part=None if prior is None else prior.T,
        covariance=None if prior is None else prior.C,
        box=None if file.box is None else file.box.to_box(),
        table=None if file.table is None else file.table.to_table(),
        rests=tuple(one.to_table() for one in file.rests),
    )


def prior_brand(path: str | Path) -> Brand | None:
    """Return the brand in whose convention a file writes its prior pose; None for tanteo's own convention.

    Args:
        path: file that :func:`read_prior` accepts.
    """
    prior = _load(path).pose_prior
    return next((BRANDS[name] for name in ([] if prior is None else prior.at.has(*BRANDS))), None)


def _load(path: str | Path) -> PriorFile:
    return load_toml(Path(path), "file with the prior pose", PriorFile)
