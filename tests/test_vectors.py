"""The numeric test vectors that were computed at 60 digits, independently of this package."""

from __future__ import annotations

import json
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

SPEC = spec_from_file_location("check_vectors", Path(__file__).with_name("check_vectors.py"))
check_vectors = module_from_spec(SPEC)
SPEC.loader.exec_module(check_vectors)

FILE = Path(__file__).parents[2] / "shared" / "facts" / "vectors.json"
VECTORS = json.loads(FILE.read_text())["vectors"] if FILE.is_file() else []


@pytest.mark.skipif(not VECTORS, reason=f"the file of test vectors is not here: {FILE}")
@pytest.mark.parametrize("fn", sorted(check_vectors.FUNCTIONS))
def test_vectors(fn):
    chosen = [vector for vector in VECTORS if vector["fn"] == fn]
    assert chosen, f"no vector of {fn}"
    wrong = [line for vector in chosen for line in check_vectors.check(vector)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.skipif(not VECTORS, reason=f"the file of test vectors is not here: {FILE}")
def test_a_wrong_number_is_found():
    vector = json.loads(json.dumps(next(v for v in VECTORS if v["fn"] == "gate")))
    vector["expected"]["D2"] *= 1 + 1e-9
    assert check_vectors.check(vector)
    assert check_vectors.check({"id": "x", "fn": "nonsense", "inputs": {}, "expected": {}, "rtol": 1})
