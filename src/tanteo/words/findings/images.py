"""Findings on what an image shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class NothingSeen(Finding):
    """The image shows nothing that can be a part."""

    kind: ClassVar[str] = "nothing_seen"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class NoPartOnTable(Finding):
    """The image shows no part on the table, and no prior pose is given."""

    kind: ClassVar[str] = "no_part_on_table"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class OutlineCut(Finding):
    """An object leaves the image, so its outline does not select among very many parts.

    Attributes:
        count: number of parts.
    """

    kind: ClassVar[str] = "outline_cut"
    role: ClassVar[Role] = "verdict"
    count: int


@dataclass(frozen=True, slots=True)
class SimilarOutlines(Finding):
    """Very many parts that were not searched have an outline like the one in the image.

    Attributes:
        part: name of the best part that was searched; empty if none was found.
        count: number of parts that were not searched.
    """

    kind: ClassVar[str] = "similar_outlines"
    role: ClassVar[Role] = "verdict"
    part: str
    count: int


@dataclass(frozen=True, slots=True)
class UnknownInImage(Finding):
    """The unknown object explains the image better than any part.

    Attributes:
        unknown: its probability.
        part: name of the closest part; empty if there is none.
        probability: posterior of that part.
    """

    kind: ClassVar[str] = "unknown_in_image"
    role: ClassVar[Role] = "verdict"
    unknown: float
    part: str = ""
    probability: float = 0.0


@dataclass(frozen=True, slots=True)
class DecidingTouch(Finding):
    """An image leaves two answers, and one touch from above decides between them.

    Attributes:
        answers: names of the parts of the two answers.
        place: x and y of the touch in the world [m].
        heights: z of the surface there, by the first and the second answer [m]; 0 is the table.
    """

    kind: ClassVar[str] = "deciding_touch"
    role: ClassVar[Role] = "verdict"
    answers: tuple[str, str]
    place: tuple[float, float]
    heights: tuple[float, float]


@dataclass(frozen=True, slots=True)
class EdgesFitBadly(Finding):
    """The edges of the image fit the best answer badly.

    Attributes:
        p_value: p-value of the fit.
    """

    kind: ClassVar[str] = "edges_fit_badly"
    p_value: float
