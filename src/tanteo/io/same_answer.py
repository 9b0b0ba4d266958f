"""Whether two result documents say the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_ROUNDING = 1e-6, 1e-9
"""Numbers that differ by less, relative or absolute, differ by how a processor rounds."""

_ELSEWHERE = ("version", "elapsed_s", "file")
"""What may differ between two runs."""


def differences(then: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[tuple[str, ...], bool]:
    """What differs between two documents ``tanteo.recognition/1`` beyond rounding, and whether anything at all does.

    Args:
        then: the recorded one.
        now: that of today.

    Returns:
        A line for each value that differs, and whether the documents are the same to the last bit.
    """
    pairs = list(_pairs("", then, now))
    return tuple(f"{key}: {a!r} then, {b!r} now" for key, a, b in pairs if not _close(a, b)), not pairs


def _pairs(key: str, a: Any, b: Any) -> Iterator[tuple[str, Any, Any]]:
    """The values that are not equal, with their places."""
    if isinstance(a, Mapping) and isinstance(b, Mapping) and a.keys() == b.keys():
        for name in a:
            if name not in _ELSEWHERE:
                yield from _pairs(f"{key}.{name}" if key else name, a[name], b[name])
    elif isinstance(a, Sequence) and isinstance(b, Sequence) and not isinstance(a, str) and len(a) == len(b):
        for k, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from _pairs(f"{key}[{k}]", one, other)
    elif a != b:
        yield key, a, b


def _close(a: Any, b: Any) -> bool:
    if any(isinstance(x, bool) or not isinstance(x, int | float) for x in (a, b)):
        return False
    relative, absolute = _ROUNDING
    return bool(abs(a - b) <= max(relative * max(abs(a), abs(b)), absolute))
