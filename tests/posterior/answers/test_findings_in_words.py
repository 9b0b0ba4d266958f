"""Every kind of finding is put into words, with no, one and many readings."""

import dataclasses
import json
import re
import typing

import pytest

from tanteo.io import recognition_document
from tanteo.posterior import Answer
from tanteo.words import Finding, findings, message_of
from tanteo.words.sentences import sentence

CONCRETE = [
    kind
    for kind in vars(findings).values()
    if isinstance(kind, type) and issubclass(kind, Finding) and hasattr(kind, "kind")
]


CHOICES = {
    "mistake": ("mirrored", "radians"),
    "shape": ("line", "circle"),
    "cause": ("few", "spread", "open", "alone"),
    "text": ("Stop.",),
}
"""Values of fields that have a fixed set of them; the causes of a rim, a click and a feature differ by type."""


TUPLES = {
    "tuple[float, ...]": lambda k: 1e-3 * (k + 1),
    "tuple[tuple[str, int], ...]": lambda k: (f"thing {k}", k + 1),
    "tuple[tuple[float, float, float], ...]": lambda k: (0.1 * k, 0.2, 0.3),
    "tuple[tuple[float, ...], ...]": lambda k: (0.1 * k, 0.2, 0.3),
    "tuple[tuple[str, ...], ...]": lambda k: (f"reading {k}",),
}
"""Values of tuples of numbers and of pairs, by their annotation."""


def value(name, annotation, count, given=()):
    """Return a plausible value of a field, with as many names or numbers as there are readings."""
    if annotation is bool:
        return count != 1
    if annotation is int:
        return count
    if annotation is float:
        return 1.25e-3
    if str(annotation) == "float | None":
        return 0.25 if count else None
    if name in CHOICES:
        return CHOICES[name][count % len(CHOICES[name])]
    if annotation is str:
        return f"{name} a"
    if name == "goal":
        return findings.PlanGoal("wedge", "face 3" if count else "", 5e-4)
    if name in ("cause", "result", "motion", "before"):
        return findings.NoRanges()
    if name == "undetermined":
        return tuple(findings.Undetermined(f"eye {k}", ("x", "offset")) for k in range(count))
    if name == "parameters":
        return ("x", "offset", "scale")[: 1 + count]
    if name in ("ranges", "echoes", "depths"):
        return (0.1, 0.2) if count else (float("inf"), 1.0)
    if "sets" in name and name != "offsets":
        return tuple((f"{k}", f"{k}b") for k in range(count))
    if name in ("others", "on"):
        return tuple((f"thing {k}", 0.5 if name == "others" else k + 1) for k in range(count))
    if name == "volumes":
        return (1e-4, 2e-4) if count else ()
    if name == "sides":
        return ((0.1, 0.05, 0.02), (0.1, 0.05, 0.04)) if count else ()
    if name in ("answers", "place", "heights"):
        return ("wedge", "block") if name == "answers" else (1e-3 * count, 0.02)
    if name == "expected":
        return tuple(findings.ExpectedReading(f"part {k}", 0.5, f"face {k}", 0.1, 1e-3) for k in range(count))
    if name in ("start", "point", "direction"):
        return (0.0, 0.6, 0.8)
    if name == "estimate" or (name == "sds" and "estimate" in given):
        return (1e-4, 2e-4, -3e-4) if count else ()
    if name == "prior_sds":
        return (1e3,) * count
    if kinds := TUPLES.get(str(annotation)):
        return tuple(kinds(k) for k in range(count))
    if name in ("distances", "lengths"):
        return tuple(1e-3 * (k + 1) for k in range(count))
    if name == "worst":
        return findings.WorstReading("7", 4.2) if count else None
    if name == "units" and "tuple" not in str(annotation):
        return findings.UnitsQuestion(0.2, 2, 210.0, ("mm",)) if count else None
    if annotation == tuple[str, str]:
        return ("wedge", "block")
    assert "tuple[str, ...]" in str(annotation), (name, annotation)
    return tuple(f"{name} {k}" for k in range(count))


def made(kind, count):
    annotations = typing.get_type_hints(kind)
    count = max(count, 2) if kind in (findings.SeveralEqual, findings.SharedEstimates) else count
    values = {one.name: value(one.name, annotations[one.name], count, annotations) for one in dataclasses.fields(kind)}
    if typing.get_origin(annotations.get("cause")) is typing.Literal:
        values["cause"] = typing.get_args(annotations["cause"])[count % 3]
    if annotations.get("cause") is Finding:
        values["cause"] = findings.NoRanges()
    return kind(**values)


def test_estimates_equal_to_their_prior_are_omitted():
    names, values, sds, priors = ("scale", "drift along x"), (1e-4, 0.0), (1e-5, 9e-4), (1e-4, 1e-3)
    words = sentence(findings.SharedEstimates(names, values, sds, ("1", "m"), priors))
    assert "scale 0.00010" in words
    assert "drift" not in words


@pytest.mark.parametrize("count", [0, 1, 12])
@pytest.mark.parametrize("kind", CONCRETE, ids=lambda kind: kind.__name__)
def test_every_kind_has_words(kind, count):
    words = sentence(made(kind, count))
    if kind in (findings.WholeMismatch, findings.RepeatedNames) and not count:  # no answer has an empty one
        assert words == ""
        return
    assert words[-1] in ".?)" or kind is findings.PlacesSensed
    assert not re.search(r"\bnan\b|  |\(\)|, and [,.]|\b1 readings\b|: [.,]|: and", words), words


def test_kinds_have_names_and_roles():
    assert len(CONCRETE) > 40
    for kind in CONCRETE:
        assert kind.role in typing.get_args(findings.Role)
    verdicts = [kind.kind for kind in CONCRETE if kind.role == "verdict"]
    assert len(set(verdicts)) == len(verdicts)


def test_a_message_has_all_but_the_questions():
    found = findings.Located("wedge", float("nan"), 1e-4), findings.MirrorQuestion("wedge", 0.999)
    answer = Answer("recognized", found, (), 0.0)
    assert answer.message == message_of(found) == "wedge, located to 0.1 mm (largest corner sd)."
    more = answer.adding(findings.ThinnedReadings(1000, 5000))
    assert more.message.startswith(f"{answer.message} 1,000 of the 5,000 readings")
    assert more.findings[:2] == found


def test_a_mirrored_file_is_named_where_a_mirror_image_fits():
    assert "Is the part's file mirrored" in findings.MirrorQuestion("wedge", 0.999).message


def test_documents_have_the_numbers_of_the_text():
    scatter = findings.Scatter(2.5, 1.8, 3.4, findings.WorstReading("7", 4.2))
    document = recognition_document(Answer("unknown", (findings.NoPart(), scatter), (), 1.0))
    assert json.dumps(document)
    assert document["findings"][0] == {
        "kind": "no_part", "role": "verdict", "message": sentence(findings.NoPart()),
        "values": {"part": "", "missing": [], "present": [], "freeform": False},
    }  # fmt: skip
    assert document["findings"][1]["values"] == {
        "scale": 2.5, "low": 1.8, "high": 3.4, "worst": {"reading": "7", "sds": 4.2, "normal": False}, "part": "",
    }  # fmt: skip
