"""Plan the update of a catalogue: which parts stay in place, which are copied, and which files are read."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from tanteo.catalogue.opened import Catalogue
from tanteo.catalogue.pool import Request
from tanteo.catalogue.segment import MOST, Segment

SEGMENTS = 24
"""Number of segments above which small segments are merged."""

NO_KEY = "0" * 64
"""Key of a file that is read every time, because it refers to other files or is too large."""

Place: TypeAlias = tuple[Segment, int]
"""Segment, and the number of a part in it."""


class Plan:
    """Division of an update into segments that stay, parts that are copied, and files that are read.

    Attributes:
        whole: segments that stay unchanged.
        copied: positions of parts that are copied, each with the request that renames it or None.
        todo: requests that must be read, by number.
        keys: file hashes of all requests.
        requests: all requests.
        kept: number of parts that are not read again.
        in_place: number of parts in the unchanged segments.
    """

    def __init__(self, old: Catalogue | None, requests: list[Request], keys: list[str], *, adding: bool) -> None:
        places = _places(old)
        self.keys, self.requests = keys, requests
        self.todo: dict[int, Request] = {}
        wanted: dict[Place, Request | None] = {}
        if adding and old is not None:
            again = {os.path.realpath(one.path) for one in requests}
            for segment in old.segments:
                for row in range(len(segment)):
                    if os.path.realpath(segment.text(row)[1]) not in again:
                        wanted[segment, row] = None
        for k, (request, key) in enumerate(zip(requests, keys, strict=True)):
            place = next((p for p in places.get(key, ()) if p not in wanted), None) if key != NO_KEY else None
            if place is None:
                self.todo[k] = replace(request, key=None if key == NO_KEY else key, record=True)
            else:
                wanted[place] = request
        self.kept = len(wanted)
        self.whole, self.copied = self._sorted(old, wanted)
        self.in_place = sum(map(len, self.whole))

    def _sorted(
        self, old: Catalogue | None, wanted: Mapping[Place, Request | None]
    ) -> tuple[list[Segment], list[tuple[Place, Request | None]]]:
        """Return the segments in which every part stays unchanged, and the other parts that are kept."""
        segments = old.segments if old is not None else ()
        same = {place for place, request in wanted.items() if request is None or _is_named(place, request)}
        whole = [s for s in segments if all((s, row) in same for row in range(len(s)))]
        if len(whole) > SEGMENTS:
            whole = [s for s in whole if len(s) > MOST // 2]
        staying = {id(s) for s in whole}
        return whole, [(place, request) for place, request in wanted.items() if id(place[0]) not in staying]


def _is_named(place: Place, request: Request) -> bool:
    segment, row = place
    return segment.text(row)[:2] == [request.name, request.path]


def _places(old: Catalogue | None) -> dict[str, list[Place]]:
    """Return the positions of the parts by file hash."""
    out: dict[str, list[Place]] = {}
    for segment in old.segments if old is not None else ():
        for row, key in enumerate(segment.keys()):
            out.setdefault(key, []).append((segment, row))
    return out


def by_source(old: Catalogue) -> dict[str, str]:
    """Return the names of parts by the real path of their file.

    Args:
        old: existing catalogue.
    """
    texts = (segment.text(row) for segment in old.segments for row in range(len(segment)))
    return {os.path.realpath(source): name for name, source, _ in texts}


def named(requests: list[Request], known: Mapping[str, str], taken: set[str]) -> list[Request]:
    """Return the requests with the names that their files have in the catalogue; new names are made unique.

    Args:
        requests: requests to name.
        known: names by real path, see :func:`by_source`.
        taken: names in use; updated in place.
    """
    out = []
    for one in requests:
        name = known.get(os.path.realpath(one.path))
        if name is None:
            longer = (one.name, Path(one.path).name, str(Path(one.path).resolve()))
            name = next(name for name in longer if name not in taken)
            taken.add(name)
        out.append(replace(one, name=name))
    return out
