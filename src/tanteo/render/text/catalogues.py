"""Catalogues as lines of text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tanteo.render.text.layout import PLAIN, Layout, printable


class _Catalogue(Protocol):
    @property
    def folder(self) -> object: ...
    @property
    def size(self) -> int: ...
    @property
    def paths(self) -> Sequence[str]: ...
    @property
    def names(self) -> Sequence[str]: ...
    @property
    def segments(self) -> Sequence[object]: ...
    def __len__(self) -> int: ...


def catalogue_lines(catalogue: _Catalogue, *, names: bool = False, layout: Layout = PLAIN) -> list[str]:
    """Return a catalogue as lines of text: number of parts, size, and files.

    Args:
        catalogue: open catalogue.
        names: whether to add the names of all parts.
        layout: width and style of the output.
    """
    count = len(catalogue)
    lines = [
        layout.bold(f"{printable(str(catalogue.folder))}: {count} part{'s' * (count != 1)}"),
        f"  size      {catalogue.size / 1e6:.3g} MB, {catalogue.size / max(count, 1) / 1e3:.3g} kB a part",
        f"  segments  {len(catalogue.segments)}",
        f"  files     {printable(', '.join(catalogue.paths))}",
    ]
    return lines + [f"  {printable(name)}" for name in catalogue.names] if names else lines
