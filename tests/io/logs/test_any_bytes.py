"""A damaged sample is read or refused with the file's name: never another exception, never a hang."""

from __future__ import annotations

import numpy as np
import pytest

from log_cases import CASES
from tanteo.errors import InputError
from tanteo.io import read_readings


def spoiled(data: bytes, rng: np.random.Generator) -> bytes:
    """Return the sample with a few bytes changed, removed or repeated."""
    out = bytearray(data)
    for _ in range(rng.integers(1, 6)):
        k, n = int(rng.integers(0, max(len(out), 1))), int(rng.integers(1, 30))
        kind = rng.integers(0, 4)
        if kind == 0:
            out[k : k + 1] = bytes([int(rng.integers(0, 256))])
        elif kind == 1:
            del out[k : k + n]
        elif kind == 2:
            out[k:k] = out[k : k + n]
        else:
            out[k : k + 1] = rng.choice([b"nan", b"1e999", b"-", b"\n", b",", b"99999999999999", b"\0", b"{", b"["])
    return bytes(out)


@pytest.mark.parametrize("case", CASES)
def test_spoiled_samples_are_read_or_refused(tmp_path, case):
    name, content, stated = CASES[case]
    data = content if isinstance(content, bytes) else content.encode()
    rng = np.random.default_rng(len(data))
    path = tmp_path / "log"
    for k in range(25):
        path.write_bytes(spoiled(data, rng))
        readings, complaint = None, ""
        try:
            readings = read_readings(path, format=name if k % 2 else None, **stated)
        except InputError as error:
            complaint = str(error)
        assert (readings is not None) != complaint.startswith(str(path)), complaint
        assert readings is None or (len(readings) > 0 and not np.isinf(readings.points.values).any())
