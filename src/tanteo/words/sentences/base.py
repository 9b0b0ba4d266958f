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
    """Return a finding as text: what is found, then what to do."""
    return " ".join(filter(None, words_of(finding)))


def headline_of(findings: Iterable[Finding]) -> str:
    """Return the verdict as text without advice; empty if there is no verdict."""
    return _split(findings)[0]


def details_of(findings: Iterable[Finding]) -> str:
    """Return the message of an answer without its headline, for readers who have the headline already."""
    return " ".join(_split(findings)[1])


def message_of(findings: Iterable[Finding]) -> str:
    """Return the message of an answer: its headline, then the other findings in order, without questions.

    If a question names what the user may have meant otherwise, the verdict advises to check that and nothing else: the
    advice for correct readings, such as to add the file of another part, would lead away from the mistake.
    """
    headline, details = _split(findings)
    return " ".join(filter(None, [headline, *details]))


def _split(findings: Iterable[Finding]) -> tuple[str, list[str]]:
    """Return the text of the first verdict, and the sentences that follow it."""
    found = tuple(findings)
    subject = next((one.subject for one in found if one.subject), "")
    first = next((one for one in found if one.role == "verdict"), None)
    exact = any(one.names_step for one in found)
    headline, details = "", []
    for one in found:
        if one.role == "question":
            continue
        text, advice = words_of(one)
        if one is first:
            headline = text
        else:
            details.append(text)
        if exact and one is first and not subject:
            continue
        details.append(f"Check {subject} first." if subject and one.role == "verdict" and advice else advice)
    return headline, [text for text in details if text]
