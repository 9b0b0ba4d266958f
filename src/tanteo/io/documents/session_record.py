"""Write a session as a record (``tanteo.session/1``, JSON or in MCAP) and restore it (``docs/formats_json.md``)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from tanteo import __version__
from tanteo.defaults import SIGNIFICANCE
from tanteo.errors import InputError
from tanteo.geometry.typing import BoolArray
from tanteo.io.documents.document import made, table
from tanteo.io.documents.part_files import part_file, parts_of
from tanteo.io.documents.record_tables import (
    HERE,
    ActionTable,
    ObservationTable,
    PosePriors,
    SensingTable,
    SessionRecord,
)
from tanteo.io.documents.result_json import recognition_document
from tanteo.io.documents.schema import Place, as_plain, show
from tanteo.io.documents.session_mcap import SUFFIX, is_mcap, record_text, write_mcap
from tanteo.parts import RECORD, Part, read_whole
from tanteo.planning import POLICIES, Observation, Sensing, SensingState, Session
from tanteo.planning.candidates import Candidates
from tanteo.planning.context import Policy
from tanteo.planning.start import Start
from tanteo.planning.whole import Offers
from tanteo.posterior import PreparedPart, prepare_all
from tanteo.replaced import replaced

SCHEMA = "tanteo.session/1"

_POLICIES: dict[str, Any] = {type(policy).__name__: type(policy) for policy in POLICIES.values()}


def write_record(session: Session, path: str | Path) -> None:
    """Write a session to a file, which is replaced atomically.

    A file whose name ends in ``.mcap`` also contains ROS 2 messages (``docs/ros.md``).

    Args:
        session: session to write.
        path: file to write.

    Raises:
        InputError: the session's policy is not one of tanteo's, so it cannot be stored.
        MissingExtraError: the packages for MCAP are not installed.
        OSError: the file cannot be written.
    """
    document = session_document(session)
    if Path(path).suffix.lower() == SUFFIX:
        write_mcap(session, document, path)
        return
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    with replaced(path) as file:
        file.write_text(text + "\n", encoding="utf-8")


def session_document(session: Session) -> dict[str, Any]:
    """Return the record of a session as plain dictionaries, lists, strings and numbers.

    Args:
        session: session to write.

    Raises:
        InputError: the session's policy is not one of tanteo's, so it cannot be stored.
    """
    start = session.start
    policy = session.policy
    kind = type(policy).__name__
    if type(policy) is not _POLICIES.get(kind):
        raise InputError(f"policy: expected one of {', '.join(POLICIES)}, got {kind}. A record can hold only these.")
    record = SessionRecord(
        at=HERE,
        schema=SCHEMA,
        version=__version__,
        parts=tuple(part_file(target.part) for target in start.targets),
        start=PosePriors(start.part, start.Ts, start.covariances, start.weights, start.priors),
        probe=session.probe,
        sensing=SensingTable.of(session.sensing),
        policy={"kind": kind, **as_plain(policy)},
        stop=session.stop,
        seed=int(session.seed),
        observations=tuple(map(ObservationTable.of, session.observations)),
        pending=ActionTable.of(session.pending),
        refused=tuple(filter(None, map(ActionTable.of, session.refused))),
        questions=int(session.questions),
        answer=recognition_document(session.answer()),
        significance=session.significance,
        seen=_seen_document(start),
    )
    document = dict(as_plain(record))
    if record.seen is None:
        del document["seen"]
    if session.significance == SIGNIFICANCE:
        del document["significance"]
    return document


def _seen_document(start: Start) -> Any:
    """Return the images of a start as plain values; None without any.

    Raises:
        InputError: the start has factors that a record cannot hold.
    """
    if not start.factors:
        return None
    from tanteo.io.image_record import SeenTable

    return as_plain(SeenTable.of(start))


def _with_images(values: dict[str, Any], targets: Sequence[PreparedPart], record: SessionRecord) -> dict[str, Any]:
    """Return the values of a start with the images of a record as its factors.

    Raises:
        InputError: the record has an invalid statement about images.
        MissingExtraError: without OpenCV (the extra ``vision``).
    """
    if record.seen is None:
        return values
    from tanteo.io.image_record import SeenTable

    seen = table(SeenTable, record.seen, record.at.inside("seen"))
    place = f"{record.source}, seen"
    rows = {"part": values["part"], "Ts": values["Ts"], "covariances": values["covariances"], "w": values["weights"]}
    factors = made(seen.factors, {"targets": targets, **rows}, place)
    return {**values, "factors": factors, "suggested": seen.suggested}


def load_record(path: str | Path) -> SessionRecord:
    """Read a record file without reading its parts.

    Args:
        path: record file, JSON or MCAP.

    Raises:
        InputError: the file cannot be read, or is not a complete record; the message names file and key.
    """
    path = Path(path)
    record = table(SessionRecord, _read(path), Place(str(path), "Restore the written record."))
    _policy(record)
    observations = [one.observation() for one in record.observations]
    actions = [*(one.action for one in observations), record.pending, *record.refused]
    least = max((action.number for action in actions if action), default=0)
    if record.questions < least:
        raise record.at.refused("questions", f"{least} or more, the largest number of a question", "Correct it.")
    return record


def _read(path: Path) -> Any:
    """Return the parsed JSON of a record file."""
    whole = record_text(path).encode() if is_mcap(path) else read_whole(path, "a record", RECORD)
    try:
        raw = msgspec.json.decode(whole.decode("utf-8-sig"))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(
            f"{path}: expected the JSON of a whole session, got: {show(str(error))}. If the file is cut, take a copy."
        ) from None
    got = raw.get("schema", "none") if isinstance(raw, dict) else SCHEMA
    if got != SCHEMA:
        raise InputError(f"{path}, schema: expected {SCHEMA}, got {show(got)}. Give the record of a session.")
    return raw


def _policy(record: SessionRecord) -> Policy:
    """Return the policy that chooses the next reading."""
    raw = record.policy
    kind = _POLICIES.get(str(raw.get("kind"))) if isinstance(raw, dict) else None
    if not isinstance(raw, dict) or kind is None:
        raise record.at.refused("policy", f"'kind' to be one of {', '.join(_POLICIES)}")
    options = {name: option for name, option in raw.items() if name != "kind"}
    policy: Policy = table(kind, options, record.at.inside("policy"))
    return policy


def resumed(
    record: SessionRecord,
    parts: Sequence[Part | PreparedPart],
    progress: Callable[[int, int], None] | None = None,
    able: Callable[[SensingState, Candidates], BoolArray] | None = None,
    whole: Callable[[SensingState], Offers] | None = None,
) -> Session:
    """Restore the session of a record, with the same posterior and the same next action.

    Args:
        record: record of the session.
        parts: parts of the record, see :func:`tanteo.io.documents.part_files.parts_of`, or the same parts prepared.
        progress: function called before each observation with the number processed and the total number.
        able: function that returns which candidate actions are feasible, see :attr:`~tanteo.planning.Session.able`. A
            record does not store the hand; without this function infeasible actions may be chosen.
        whole: function that returns features that can be acquired as a whole, see
            :attr:`~tanteo.planning.Session.whole`; without it none is chosen.

    Raises:
        InputError: entries of the record contradict each other.
    """
    rough = record.start
    values = {name: getattr(rough, name) for name in PosePriors.__slots__}
    targets = prepare_all("parts", parts)
    values = _with_images(values, targets, record)
    start = made(Start, {"targets": targets, **values}, f"{record.source}, start")
    errors = tuple(one.state() for one in record.sensing.shared_errors)
    sensing = Sensing(**record.sensing.values() | {"shared_errors": errors})
    session = made(
        Session,
        {
            "start": start, "probe": record.probe, "sensing": sensing, "policy": _policy(record), "stop": record.stop,
            "seed": record.seed, "able": able, "whole": whole, "significance": record.significance,
        },
        record.source,
    )  # fmt: skip

    def observations() -> Iterator[Observation]:
        for k, one in enumerate(record.observations):
            if progress is not None:
                progress(k, len(record.observations))
            yield one.observation()

    pending = None if record.pending is None else record.pending.action()
    refused = [one.action() for one in record.refused]
    try:
        session.resume(observations(), pending, refused, record.questions)
    except InputError as error:
        raise InputError(f"{record.source}, observations[{len(session.steps)}]: {error}") from None
    return session


def read_record(
    path: str | Path,
    parts: Sequence[Part | PreparedPart] | None = None,
    able: Callable[[SensingState, Candidates], BoolArray] | None = None,
    whole: Callable[[SensingState], Offers] | None = None,
) -> Session:
    """Read a record file and restore its session at the point where it was written.

    Args:
        path: record file.
        parts: parts of the session, in any order; None to read them from their files.
        able: function that returns which candidate actions are feasible, see :func:`resumed`.
        whole: function that returns features that can be acquired as a whole, see :func:`resumed`.

    Raises:
        InputError: the record is invalid, or a part has changed; the message names it and the correction.
    """
    record = load_record(path)
    return resumed(record, parts_of(record.parts, record.source, parts), able=able, whole=whole)
