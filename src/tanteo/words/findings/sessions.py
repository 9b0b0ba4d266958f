"""Findings of a session, which asks for one reading after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class NothingMet(Finding):
    """No reading of a session has met a part yet."""

    kind: ClassVar[str] = "nothing_met"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class EmptySpace(Finding):
    """Beams met nothing at every place where the part may be."""

    kind: ClassVar[str] = "empty_space"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class NoPartLeft(Finding):
    """No part at any prior pose explains the readings of a session."""

    kind: ClassVar[str] = "no_part_left"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class WiderPrior(Finding):
    """A session contradicts its prior pose, and a new one may have a wider one."""

    kind: ClassVar[str] = "wider_prior"
    role: ClassVar[Role] = "advice"


@dataclass(frozen=True, slots=True)
class MovedMeanwhile(Finding):
    """The readings that do not fit are together in time: something may have moved.

    Attributes:
        first: id of the first of them.
        last: id of the last one.
        outliers: their number, where the readings between fit in part; 0 where all of these do not fit.
        fitting: id of the reading beyond which all fit.
        after: whether the fitting ones come after that reading; otherwise before.
    """

    kind: ClassVar[str] = "moved"
    first: str
    last: str
    outliers: int
    fitting: str
    after: bool
