"""The base of all findings, and what a finding is for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

Role = Literal["verdict", "cause", "advice", "question"]
"""What a finding is for: the verdict itself, what it rests on or what is odd, what to do, or what the user may have
meant otherwise. Questions stand beside the message, not in it."""

Share = tuple[str, float]
"""Name of a part and its probability."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Base of all findings.

    Attributes:
        kind: name of the kind, as documents have it.
        role: what the finding is for.
        subject: what a question asks the user to check; empty for other findings.
    """

    kind: ClassVar[str]
    role: ClassVar[Role] = "cause"
    subject: ClassVar[str] = ""

    @property
    def message(self) -> str:
        """The finding in words."""
        from tanteo.words.sentences import sentence

        return sentence(self)
