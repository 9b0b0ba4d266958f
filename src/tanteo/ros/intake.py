"""Conversion of incoming messages into readings as soon as their frames are known; dropped messages are counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from tanteo import io
from tanteo.errors import ReadingsError
from tanteo.sensors import Readings

_HISTORY = 30.0
"""Time for which the poses of moving frames are stored [s]."""
_MARGIN = 2.0
"""Time before the first waiting reading from which transforms are kept [s]."""
_AHEAD = 1.0
"""Largest time by which a stamp may be in the future [s]; a larger one means that the clocks differ."""
_SOURCE = "tanteo ros"


@dataclass(frozen=True, slots=True)
class Patience:
    """Waiting times and age limits of messages.

    Attributes:
        start: time after the first reading after which the tree of frames counts as complete [s].
        transform: time to wait for the transforms at the stamp of a reading [s].
        age: largest age of a reading on arrival [s]; older ones are dropped.
        every: smallest time between two used readings of a topic [s].
    """

    start: float = 1.0
    transform: float = 1.0
    age: float = 10.0
    every: float = 0.0


class Waiting(NamedTuple):
    """Reading that waits for its frame: topic, row and time of arrival [s]."""

    topic: str
    row: io.documents.Row
    came: float


@dataclass(slots=True, eq=False)
class Intake:
    """Queue of readings that wait for their frames.

    Attributes:
        options: topics, world frame and latency. The world frame is chosen once, after :attr:`Patience.start`.
        stated: options for what the messages do not contain.
        patience: waiting times and age limits.
        dropped: number of dropped readings by reason.
        notes: messages to the user, without repetitions.
        taken: number of readings that were returned.
        world: name of the frame of the readings; empty until it is known.
        latest: latest stamp of a returned reading [s]; NaN before the first.
    """

    options: io.RosOptions
    stated: io.readings.Stated
    patience: Patience = field(default_factory=Patience)
    dropped: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)
    taken: int = 0
    world: str = ""
    latest: float = np.nan
    _messages: io.documents.RosMessages = field(default_factory=io.documents.RosMessages)
    _waiting: list[Waiting] = field(default_factory=list)
    _waiting_rows: set[io.documents.Row] = field(default_factory=set)
    _last: dict[str, float] = field(default_factory=dict)
    _world_announced: bool = field(init=False)
    _begun: float = np.nan
    _forgotten: float = np.nan

    def __post_init__(self) -> None:
        self._world_announced = self.options.world is not None

    def register(self, topic: str, kind: str) -> None:
        """Register a topic with its message type.

        Args:
            topic: name of the topic.
            kind: type of its messages.

        Raises:
            ReadingsError: The chosen topics have both ranges and points.
        """
        self._messages.kinds[topic] = kind
        kinds = {kind for kind in self._messages.kinds.values() if kind in (io.documents.RANGE, io.documents.POINT)}
        if len(kinds) > 1 and self.options.topics:
            raise ReadingsError(
                f"{_SOURCE}, --topic: expected topics of one type, got ranges and points. Name topics of one type."
            )
        if kind in (io.documents.RANGE, io.documents.POINT) and not self.options.topics:
            self.notify(f"Readings come from {topic}. Choose other topics with --topic.")
        if len(kinds) > 1:
            self.notify("Both ranges and points arrive. The ranges are used. Choose other topics with --topic.")

    def take(self, topic: str, now: float, message: Any) -> None:
        """Add a message.

        Args:
            topic: name of a registered topic.
            now: time of arrival [s].
            message: message of the topic's type.
        """
        messages = self._messages
        messages.take(topic, now, message)
        if messages.kinds[topic] not in (io.documents.RANGE, io.documents.POINT):
            if messages.overlaps:
                self._set_back()
            return
        messages.overlaps.clear()  # a clock of a sensor does not affect the frames
        for row in messages.rows.pop(topic, ()):
            self._admit(Waiting(topic, row, now))

    def _set_back(self) -> None:
        messages = self._messages
        self.notify("A clock was set back. Stored poses of moving frames and waiting readings were discarded.")
        self.dropped["a clock was set back"] += len(self._waiting)
        self._waiting.clear()
        self._waiting_rows.clear()
        self._last.clear()
        messages.overlaps.clear()
        messages.rows = {topic: rows[-1:] for topic, rows in messages.rows.items()}
        for key, samples in messages.samples.items():
            if key[0] not in messages.static:
                messages.samples[key] = samples[-1:]

    def _admit(self, one: Waiting) -> None:
        stamp, kinds = one.row.stamp, self._messages.kinds
        self._begun = float(np.fmin(self._begun, one.came))  # a simulated clock may be set back
        if kinds[one.topic] != io.documents.RANGE and io.documents.RANGE in kinds.values():
            self.dropped["type other than ranges"] += 1
        elif not io.documents.is_usable(kinds[one.topic], one.row):
            self.dropped["below the smallest range, or not a number"] += 1
        elif one.came - stamp > self.patience.age:
            self.dropped["older than --max-age on arrival"] += 1
        elif stamp - one.came > _AHEAD:
            self.dropped["stamp in the future: clocks differ"] += 1
        elif one.row in self._waiting_rows or stamp == self._last.get(one.topic):
            self.dropped["duplicate"] += 1
        elif stamp - self._last.get(one.topic, -np.inf) < self.patience.every:
            self.dropped["less than --every after the last one"] += 1
        else:
            self._last[one.topic] = stamp
            self._waiting.append(one)
            self._waiting_rows.add(one.row)

    def ready(self, now: float) -> Readings | None:
        """Return new readings whose frames are known, or None without any.

        Args:
            now: current time [s].

        Raises:
            ReadingsError: The messages lack information that must be stated in the options.
        """
        self._forget(now)
        if not self._waiting or now - self._begun < self.patience.start:
            return None
        recent = self._recent(self._waiting)
        known = self._placed(recent, now)
        ready = [one for one, is_known in zip(self._waiting, known, strict=True) if is_known]
        late = [now - one.came > self.patience.transform for one in self._waiting]
        lost = sum(is_late and not is_known for is_late, is_known in zip(late, known, strict=True))
        self.dropped["no transform at its stamp"] += lost
        self._waiting = [
            one for one, k, is_late in zip(self._waiting, known, late, strict=True) if not k and not is_late
        ]
        self._waiting_rows = {one.row for one in self._waiting}
        return self._readings(ready, recent) if ready else None

    def _placed(self, recent: io.documents.RosMessages, now: float) -> list[bool]:
        """Return flags of the waiting rows whose frame is known; an unknown frame does not delay the others."""
        tree = recent.tree()
        known = [False] * len(self._waiting)
        for frame in dict.fromkeys(one.row.frame for one in self._waiting):
            mine = [k for k, one in enumerate(self._waiting) if one.row.frame == frame]
            placed = self._of_frame(recent, tree, [self._waiting[k] for k in mine], now)
            for k, is_known in zip(mine, placed, strict=True):
                known[k] = is_known
        return known

    def _recent(self, rows: list[Waiting]) -> io.documents.RosMessages:
        """Return the messages that the rows need."""
        return self._messages.since(min(one.row.stamp for one in rows) - self.options.latency - _MARGIN)

    def _forget(self, now: float) -> None:
        """Drop messages that are too old for any reading."""
        if not now - self._forgotten < _HISTORY / 10:
            self._forgotten = now
            self._messages = self._messages.since(now - _HISTORY - self.options.latency)

    def _of_frame(self, messages: io.documents.RosMessages, tree: Any, rows: list[Waiting], now: float) -> list[bool]:
        beams = io.documents.RANGE in messages.kinds.values()
        try:
            place = io.readings.placing(messages, tree, [one.row for one in rows], beams, _SOURCE, self.options)
        except ReadingsError as error:
            if now - rows[0].came > self.patience.transform:
                self.notify(str(error))
            return [False] * len(rows)
        if place.known.any():
            self.world = place.world
            if place.hand is None:  # chosen once: a later root is a different frame
                self.options = replace(self.options, world=place.world)
        for note in place.notes:
            self.notify(note)
        if place.hand is None and (root := tree.chain(place.world)[-1]) != place.world and not self._world_announced:
            self.notify(
                f"The frame '{root}' is now above the world frame '{place.world}'. Restart the node if '{root}' moves."
            )
        return place.known.tolist()

    def _readings(self, ready: list[Waiting], heard: io.documents.RosMessages) -> Readings:
        of_topic: dict[str, list[io.documents.Row]] = {}
        for one in ready:
            of_topic.setdefault(one.topic, []).append(one.row)
        poses = {topic: rows for topic, rows in heard.rows.items() if heard.kinds[topic] == io.documents.POSE}
        batch = io.documents.RosMessages(heard.samples, heard.static, poses | of_topic, heard.kinds)
        topics = replace(self.options, topics=())
        readings = io.readings.readings_of_messages(batch, _SOURCE, self.stated, topics)
        self.latest = max(one.row.stamp for one in ready)
        first = self.taken + 1
        self.taken += len(readings)
        return replace(readings, ids=tuple(str(k) for k in range(first, first + len(readings))))

    def notify(self, note: str) -> None:
        """Add a message to the user, unless it is a repetition.

        Args:
            note: text of the message.
        """
        if note not in self.notes:
            self.notes.append(note)

    def drop_counts(self) -> Iterator[tuple[str, int]]:
        """Yield each reason for which readings were dropped, with their number."""
        return ((why, count) for why, count in self.dropped.items() if count)
