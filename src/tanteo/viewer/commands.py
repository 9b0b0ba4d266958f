"""What a person may want of a player."""

from __future__ import annotations

from dataclasses import dataclass

from tanteo.typing import Vectors


@dataclass(frozen=True, slots=True)
class Go:
    """Go on by itself."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Stay."""


@dataclass(frozen=True, slots=True)
class Advance:
    """Go on to the next place."""


@dataclass(frozen=True, slots=True)
class Restart:
    """Begin again, with the policy and the seed that are chosen then."""


@dataclass(frozen=True, slots=True)
class Quit:
    """End."""


@dataclass(frozen=True, slots=True)
class Choose:
    """Another policy, seed or speed (times real time); None leaves it."""

    policy: str | None = None
    seed: int | None = None
    speed: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Click:
    """A click into the picture: a ray from the eye, world."""

    eye: Vectors
    ray: Vectors


Command = Go | Pause | Advance | Restart | Quit | Choose | Click


class Left(Exception):  # noqa: N818
    """The run was left before its end: to begin again, or for good."""

    def __init__(self, for_good: bool) -> None:
        self.for_good = for_good


def leave(command: Command) -> None:
    """Leave the run, if that is what is wanted.

    Raises:
        Left: it is.
    """
    if isinstance(command, Restart | Quit):
        raise Left(isinstance(command, Quit))
