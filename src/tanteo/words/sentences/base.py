"""From findings to sentences: one function a type, which returns what is found and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from functools import singledispatch

from tanteo.words.findings import Finding

Words = tuple[str, str]
"""What is found, and what to do about it; both in whole sentences, the second may be empty."""


@singledispatch
def words_of(finding: Finding) -> Words:
    """Return what is found and what to do."""
    raise TypeError(f"no words for {type(finding).__name__}")


def sentence(finding: Finding) -> str:
    """Return a finding in words."""
    return " ".join(filter(None, words_of(finding)))


def headline_of(findings: Iterable[Finding]) -> str:
    """Return the verdict in words without advice; empty if there is no verdict."""
    return next((words_of(one)[0] for one in findings if one.role == "verdict"), "")


def message_of(findings: Iterable[Finding]) -> str:
    """Return the message of an answer: the sentences of its findings in order, without its questions.

    If a question names what the user may have meant otherwise, the verdict advises to check that and nothing else: the
    advice for correct readings, such as to add the file of another part, would lead away from the mistake.
    """
    found = tuple(findings)
    subject = next((one.subject for one in found if one.subject), "")
    out = []
    for one in found:
        if one.role == "question":
            continue
        text, advice = words_of(one)
        out += [text, f"Check {subject} first." if subject and one.role == "verdict" and advice else advice]
    return " ".join(filter(None, out))
