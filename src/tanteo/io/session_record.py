"""A session as a record file (JSON, ``tanteo.session/1``), and the same session from it (``docs/formats.md``)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tanteo import __version__
from tanteo.active import Candidates, Policy, Probe, SensingState, Start, Stop
from tanteo.answers import Priors
from tanteo.errors import InputError
from tanteo.inference import PreparedPart, prepare_all
from tanteo.io.part_files import PartFile, part_file, parts_of
from tanteo.io.plain_values import as_plain, made, refused, shown, table
from tanteo.io.record_values import (
    observation_of,
    policy_document,
    policy_of,
    readings_document,
    sensing_document,
    sensing_of,
)
from tanteo.io.result_json import recognition_document
from tanteo.parts import Part
from tanteo.replaced import replaced
from tanteo.session import Action, Observation, Sensing, Session
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms

SCHEMA = "tanteo.session/1"

_AS_THEY_ARE = "version", "parts", "start", "probe", "stop", "seed", "asked", "refused", "questions", "answer"


@dataclass(frozen=True, slots=True, eq=False)
class PosePriors:
    """A :class:`~tanteo.active.Start` without its parts; the same fields."""

    part: IntArray
    Ts: Transforms
    covariances: Covariances
    weights: FloatArray
    priors: Priors


@dataclass(frozen=True, slots=True, eq=False)
class SessionRecord:
    """All that a session needs to be what it was.

    Attributes:
        source: the file.
        version: of tanteo that wrote it.
        parts: their files.
        start: what was assumed beforehand.
        probe: what senses.
        sensing: how readings are made into measurements.
        policy: which reading is chosen.
        stop: when to end.
        seed: of everything that draws.
        observations: what was observed, in order.
        asked: the question that waited for its answer.
        refused: the questions that could not be answered.
        questions: the largest number of a question until then.
        answer: the answer then, a document ``tanteo.recognition/1``.
    """

    source: str
    version: str
    parts: tuple[PartFile, ...]
    start: PosePriors
    probe: Probe
    sensing: Sensing
    policy: Policy
    stop: Stop
    seed: int
    observations: tuple[Observation, ...]
    asked: Action | None
    refused: tuple[Action, ...]
    questions: int
    answer: dict[str, Any]


def write_record(session: Session, path: str | Path) -> None:
    """Write all of a session to a file, which is replaced whole or not at all.

    Raises:
        InputError: the session's policy is none of those that can be named.
        OSError: the file cannot be written.
    """
    text = json.dumps(session_document(session), allow_nan=False, separators=(",", ":"))
    with replaced(path) as file:
        file.write_text(text + "\n", encoding="utf-8")


def session_document(session: Session) -> dict[str, Any]:
    """All of a session as plain dictionaries, lists, texts and numbers."""
    start = session.start
    rough = PosePriors(start.part, start.Ts, start.covariances, start.weights, start.priors)
    return {
        "schema": SCHEMA,
        "version": __version__,
        "parts": [as_plain(part_file(target.part)) for target in start.targets],
        "start": as_plain(rough),
        "probe": as_plain(session.probe),
        "sensing": sensing_document(session.sensing),
        "policy": policy_document(session.policy),
        "stop": as_plain(session.stop),
        "seed": int(session.seed),
        "observations": [
            {"asked": as_plain(t.action), "readings": readings_document(t.readings), "note": t.note}
            for t in session.observations
        ],
        "asked": as_plain(session.asked),
        "refused": [as_plain(action) for action in session.refused],
        "questions": int(session.questions),
        "answer": recognition_document(session.answer()),
    }


def load_record(path: str | Path) -> SessionRecord:
    """What a record file says; no part is read.

    Raises:
        InputError: the file cannot be read, or is not a whole record; the message names file and key.
    """
    file = Path(path)
    document = _document(file)
    if document.get("schema") != SCHEMA:
        got = shown(document.get("schema", "none"))
        raise InputError(f"{file}, schema: expected {SCHEMA}, got {got}. Give the record of a session.")
    kinds: dict[str, Any] = {
        "schema": str, "version": str, "parts": tuple[PartFile, ...], "start": PosePriors, "probe": Probe,
        "sensing": object, "policy": object, "stop": Stop, "seed": int, "observations": tuple[object, ...],
        "asked": Action | None, "refused": tuple[Action, ...], "questions": int,
        "answer": object,
    }  # fmt: skip
    values = table(document, kinds, str(file))
    if not isinstance(values["answer"], dict):
        raise refused(f"{file}, answer", "a table", values["answer"])
    if values["seed"] < 0:
        raise InputError(f"{file}, seed: expected 0 or more, got {values['seed']}. Correct it.")
    observations = tuple(observation_of(t, f"{file}, observations[{k}]") for k, t in enumerate(values["observations"]))
    numbered = [
        action.number for action in (*(t.action for t in observations), values["asked"], *values["refused"]) if action
    ]
    if values["questions"] < (least := max(numbered, default=0)):
        raise InputError(
            f"{file}, questions: expected {least} or more, the largest number of a question, got "
            f"{values['questions']}. Correct it."
        )
    return SessionRecord(
        source=str(file),
        sensing=sensing_of(values["sensing"], f"{file}, sensing"),
        policy=policy_of(values["policy"], f"{file}, policy"),
        observations=observations,
        **{key: values[key] for key in _AS_THEY_ARE},
    )


def resumed(
    record: SessionRecord,
    parts: Sequence[Part | PreparedPart],
    progress: Callable[[int, int], None] | None = None,
    able: Callable[[SensingState, Candidates], BoolArray] | None = None,
) -> Session:
    """The session of a record: given all of them again, it has the same belief and asks the same next.

    Args:
        record: of the session.
        parts: those of :func:`tanteo.io.part_files.parts_of`, or the same prepared.
        progress: called with (tells done, tells in all) before each.
        able: which candidates can be made, see :attr:`~tanteo.session.Session.able`: a hand is not in the record, and
            without it, what it cannot make may be asked for.

    Raises:
        InputError: what the record says together cannot be.
    """
    rough = record.start
    values = {name: getattr(rough, name) for name in PosePriors.__slots__}
    targets = prepare_all("parts", parts)
    start = made(Start, {"targets": targets, **values}, f"{record.source}, start")
    session = Session(start, record.probe, record.sensing, record.policy, record.stop, record.seed, able)

    def observations() -> Iterator[Observation]:
        for k, one in enumerate(record.observations):
            if progress is not None:
                progress(k, len(record.observations))
            yield one

    try:
        session.resume(observations(), record.asked, record.refused, record.questions)
    except InputError as error:
        raise InputError(f"{record.source}, observations[{len(session.steps)}]: {error}") from None
    return session


def read_record(
    path: str | Path,
    parts: Sequence[Part | PreparedPart] | None = None,
    able: Callable[[SensingState, Candidates], BoolArray] | None = None,
) -> Session:
    """The session of a record file, at the point where it was written: ask and tell on.

    Args:
        path: of the record.
        parts: of the session, loaded again, in any order; read from their files if not given.
        able: which candidates can be made, see :func:`resumed`.

    Raises:
        InputError: the record or a part is not what it was; the message says which and what to do.
    """
    record = load_record(path)
    return resumed(record, parts_of(record.parts, record.source, parts), able=able)


def _document(file: Path) -> dict[str, Any]:
    try:
        document = json.loads(file.read_bytes().decode("utf-8-sig"), parse_constant=_no_constant)
    except OSError as error:
        raise InputError(f"{file}: expected a record, got: {error.strerror or error}. Check the path.") from None
    except (ValueError, RecursionError) as error:  # what is not UTF-8 is a ValueError too
        raise InputError(
            f"{file}: expected the JSON of a whole session, got: {shown(str(error))}. If the file is cut, take a copy."
        ) from None
    if not isinstance(document, dict):
        raise refused(str(file), "a session", document)
    return document


def _no_constant(name: str) -> None:
    raise ValueError(f"{name}, which JSON does not have")
