"""Open a catalogue as a sequence of parts that are read at first use."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, overload
from weakref import WeakValueDictionary

import numpy as np

from tanteo.catalogue.segment import Segment
from tanteo.catalogue.store import check_formats, damaged, read_manifest
from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts import Part, StoredParts

_TRIES = 5
"""Number of attempts to read a manifest whose segments a writer replaces at the same time."""


class Catalogue(StoredParts):
    """Parts on disk, opened in milliseconds for any number of parts and readable by any number of processes.

    A catalogue is a sequence: ``catalogue[3]`` and ``catalogue["bracket"]`` are parts, and ``tanteo.identify`` accepts
    it as candidate parts. The columns for the coarse evaluation (sizes, distances between faces) are memory-mapped.

    Attributes:
        folder: folder of the catalogue.
        paths: files and folders from which it was built.

    Example:
        >>> from tanteo.catalogue.building import build_catalogue
        >>> built = build_catalogue(["parts/"], "catalogue")
        >>> catalogue = tanteo.open_catalogue("catalogue")
        >>> len(catalogue), catalogue["block"].name
        (12, 'block')
    """

    def __init__(self, folder: Path, manifest: dict[str, Any], segments: tuple[Segment, ...]) -> None:
        self.folder, self.manifest, self.segments = folder, manifest, segments
        self.paths: tuple[str, ...] = tuple(manifest.get("paths", ()))
        self.starts: IntArray = np.cumsum([0, *map(len, segments)])

    def __len__(self) -> int:
        return int(self.starts[-1])

    def __iter__(self) -> Iterator[Part]:
        return (self[k] for k in range(len(self)))

    @overload
    def __getitem__(self, which: int | str) -> Part: ...

    @overload
    def __getitem__(self, which: slice) -> tuple[Part, ...]: ...

    def __getitem__(self, which: int | str | slice) -> Part | tuple[Part, ...]:
        """Return a part by number or name, or several by a slice.

        Raises:
            InputError: there is no part of that name, or its bytes are damaged.
            IndexError: the number is out of range.
        """
        if isinstance(which, slice):
            return tuple(self[k] for k in range(*which.indices(len(self))))
        if isinstance(which, str):
            found = self.row_of(which)
            if found is None:
                known = ", ".join(self.names[:10])
                raise InputError(f"name: expected one of {known}, got {which!r}. Check the names of the parts.")
            return self[found]
        row = int(which) + (len(self) if which < 0 else 0)
        if not 0 <= row < len(self):
            raise IndexError(f"part: expected a number below {len(self)}, got {which}.")
        part = self._opened.get(row)
        if part is None:
            segment, at = self.where(row)
            part = self._opened[row] = segment.part(at)
        return part

    @cached_property
    def _opened(self) -> WeakValueDictionary[int, Part]:
        """Parts in use, so that data prepared for a part lives as long as the part."""
        return WeakValueDictionary()

    def where(self, row: int) -> tuple[Segment, int]:
        """Return the segment of a part and its number there.

        Args:
            row: number of the part.
        """
        k = int(np.searchsorted(self.starts, row, side="right")) - 1
        return self.segments[k], row - int(self.starts[k])

    def name(self, row: int) -> str:
        """Return the name of a part.

        Args:
            row: number of the part.
        """
        segment, at = self.where(row)
        return segment.text(at)[0]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parts."""
        return tuple(segment.text(row)[0] for segment in self.segments for row in range(len(segment)))

    @cached_property
    def numbers(self) -> FloatArray:
        """Sizes of all parts, see :func:`tanteo.catalogue.signatures.signature` ``(n, 17)``."""
        rows = [segment.table["numbers"] for segment in self.segments]
        return np.concatenate(rows) if rows else np.zeros((0, 17))

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {name: row for row, name in enumerate(self.names)}

    def row_of(self, name: str) -> int | None:
        """Return the number of the part with a given name; None if there is none.

        Args:
            name: name of a part.
        """
        return self._rows.get(name)

    @property
    def units(self) -> frozenset[str]:
        """Length units of the files from which the parts were read."""
        return frozenset(unit for segment in self.segments for unit in segment.known.get("units", ()))

    @property
    def size(self) -> int:
        """Size on disk without the manifest [bytes]."""
        return sum(int(s.known["bytes"]) + int(s.known["table"]["bytes"]) for s in self.segments)

    def check(self) -> None:
        """Read every byte and compare it with its checksum.

        Raises:
            InputError: a file is damaged; the message names it.
        """
        for segment in self.segments:
            segment.check()

    def __repr__(self) -> str:
        return f"Catalogue({str(self.folder)!r}, {len(self)} parts)"


def open_catalogue(path: str | os.PathLike[str]) -> Catalogue:
    """Open a catalogue for reading.

    Args:
        path: folder of the catalogue, see ``tanteo catalogue build``.

    Raises:
        InputError: there is no catalogue, or it is damaged or of another version of tanteo.

    Example:
        >>> from tanteo.catalogue.building import build_catalogue
        >>> built = build_catalogue(["parts/block.step", "parts/wedge.step"], "two")
        >>> [part.name for part in tanteo.open_catalogue("two")]
        ['block', 'wedge']
    """
    folder = Path(path)
    for k in range(_TRIES):
        manifest = read_manifest(folder)
        check_formats(folder, manifest)
        try:
            return Catalogue(folder, manifest, tuple(Segment(folder, known) for known in manifest["segments"]))
        except FileNotFoundError as error:  # a writer has replaced it since
            if k == _TRIES - 1:
                raise damaged(folder, f"no file {Path(str(error.filename)).name}") from None
        except OSError as error:
            raise damaged(folder, f"a file that cannot be read ({error.strerror or error})") from None
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise damaged(folder, f"a manifest that does not describe segments ({error})") from None
    raise AssertionError
