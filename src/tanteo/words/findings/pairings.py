"""Findings on a pose that is fitted to pairings of sensed and model features."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class PairingsAgree(Finding):
    """The pairings observe all directions and agree."""

    kind: ClassVar[str] = "pairings_agree"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class PairingsFree(Finding):
    """The pairings leave motions unobserved.

    Attributes:
        motions: these motions as text.
    """

    kind: ClassVar[str] = "pairings_free"
    role: ClassVar[Role] = "verdict"
    motions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PairingsContradict(Finding):
    """The pairings contradict each other.

    Attributes:
        p_value: p-value of their joint test.
    """

    kind: ClassVar[str] = "pairings_contradict"
    role: ClassVar[Role] = "verdict"
    p_value: float
