"""Base class and roles of findings: facts that an answer reports as sentences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

Role = Literal["verdict", "cause", "advice", "question"]
"""Role of a finding in an answer: the verdict, its cause or an oddity, advice, or a question about another meaning of
the input. A message contains all of them but questions."""

Share = tuple[str, float]
"""Name of a part and its probability."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Fact about an answer, a plan or a motion, from which a sentence for the user is made.

    Attributes:
        kind: name of the kind in documents and records.
        role: role of the finding in an answer.
        subject: part of the input that a question requests the user to check; empty for other findings.
        names_step: whether the finding names the next step exactly, which replaces the advice of the verdict.
    """

    kind: ClassVar[str]
    role: ClassVar[Role] = "cause"
    subject: ClassVar[str] = ""
    names_step: ClassVar[bool] = False

    @property
    def message(self) -> str:
        """Return the finding as sentences: what is found, then what to do."""
        from tanteo.words.sentences import sentence

        return sentence(self)
