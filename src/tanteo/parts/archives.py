"""Read zip archives with limits on the unpacked size, against damaged or malicious files."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator

from tanteo.errors import PartError

LARGEST = 512_000_000
"""Largest total size that is unpacked from one archive [bytes]."""

SMALL, RATIO = 32_000_000, 200
"""Unpacked size [bytes] above which the compression ratio is limited, and its limit; text of meshes has about 10."""

_CHUNK = 1 << 20


class Archive:
    """Files of a zip archive by name, ignoring case; the sizes stated in the archive are not trusted."""

    def __init__(self, file: zipfile.ZipFile, packed: int, label: str) -> None:
        self._file, self._packed, self._label = file, packed, label
        self._names = {info.filename.lstrip("/").lower(): info for info in file.infolist()}
        self._read = 0

    def __contains__(self, name: str) -> bool:
        return name.lower() in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(info.filename.lstrip("/") for info in self._names.values())

    def read(self, name: str) -> bytes:
        """Unpack one file.

        Args:
            name: name of the file, ignoring case.

        Raises:
            PartError: the file does not exist, or exceeds the limits; damaged archives raise the errors of ``zipfile``.
        """
        info = self._names.get(name.lower())
        if info is None:
            raise PartError(f"{self._label}: expected a file {name!r} in the archive, got none. Export it again.")
        pieces = []
        with self._file.open(info) as stream:
            while piece := stream.read(_CHUNK):
                self._read += len(piece)
                self._check()
                pieces.append(piece)
        return b"".join(pieces)

    def _check(self) -> None:
        if self._read > LARGEST or (self._read > SMALL and self._read > RATIO * self._packed):
            raise PartError(
                f"{self._label}: expected a mesh, got an archive of {self._packed:,} bytes that unpacks to more than "
                f"{self._read:,}. Export one part."
            )
