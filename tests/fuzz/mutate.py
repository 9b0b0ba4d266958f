"""Ways to spoil a file: bits, bytes, pieces, lines, numbers, and the members of archives."""

from __future__ import annotations

import io
import re
import zipfile

WORDS = (
    b"", b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"nan", b"inf", b"-1", b"0", b"1e308", b"-1e-320", b"4294967296",
    b"9223372036854775808", b"99999999999999999999", b"\r", b"\n\n", b";", b",", b"\t", b'"', b"'", b"<", b"]]>", b"[",
    b"{", b"}", b"()", b"#", b"=", b"&amp;", b"*a", b"&a", b"\xc3", b"\xed\xa0\x80", b"../../etc", b"None", b"true",
)  # fmt: skip
"""Values at unexpected places."""

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
LARGE = 60_000
"""Largest damaged length of a file at a time: its beginning identifies it."""


def mutated(content: bytes, rng) -> bytes:
    """Return the content with one to four changes; sometimes all of them inside one member of an archive."""
    if content[:2] == b"PK" and rng.random() < 0.8:
        return _in_archive(content, rng)
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        WAYS[int(rng.integers(len(WAYS)))](data, rng)
    return bytes(data)


def shortened(content: bytes, rng) -> bytes:
    """Return the content cut at a random byte, as by a copy that was interrupted."""
    return content[: int(rng.integers(len(content)))]


def _in_archive(content, rng):
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        names = old.namelist()
        spoiled = names[int(rng.integers(len(names)))]
        for name in names:
            data = old.read(name)
            if name == spoiled and rng.random() < 0.1:
                continue
            new.writestr(name, mutated(data, rng) if name == spoiled else data)
    return out.getvalue()


def _at(data, rng):
    return int(rng.integers(min(len(data), LARGE) + 1))


def _piece(data, rng):
    start = _at(data, rng)
    return start, start + int(2 ** rng.uniform(0, 9))


def flip(data, rng):
    """Flip one bit."""
    if data:
        k = min(_at(data, rng), len(data) - 1)
        data[k] ^= 1 << int(rng.integers(8))


def put(data, rng):
    """Insert a word."""
    k = _at(data, rng)
    data[k:k] = WORDS[int(rng.integers(len(WORDS)))]


def drop(data, rng):
    """Delete a piece."""
    start, stop = _piece(data, rng)
    del data[start:stop]


def double(data, rng):
    """Repeat a piece twice or a hundred times."""
    start, stop = _piece(data, rng)
    data[start:start] = bytes(data[start:stop]) * int(rng.choice([1, 100]))


def cut(data, rng):
    """Cut the end."""
    del data[_at(data, rng) :]


def number(data, rng):
    """Replace a number by another."""
    found = list(NUMBER.finditer(bytes(data[:LARGE])))
    if found:
        one = found[int(rng.integers(len(found)))]
        data[one.start() : one.end()] = WORDS[int(rng.integers(4, 13))]


def lines(data, rng):
    """Two lines change places, or one is gone."""
    rows = bytes(data).split(b"\n")
    a, b = (int(rng.integers(min(len(rows), 200))) for _ in range(2))
    rows[a], rows[b] = rows[b], rows[a]
    if rng.random() < 0.3:
        del rows[a]
    data[:] = b"\n".join(rows)


def noise(data, rng):
    """Replace a piece by random bytes."""
    start, stop = _piece(data, rng)
    stop = min(stop, len(data))
    data[start:stop] = rng.bytes(max(stop - start, 0))


WAYS = (flip, flip, put, put, drop, double, cut, number, number, lines, noise)
