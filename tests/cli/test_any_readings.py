"""Well-formed readings of nothing in particular: an answer or a message, never an exception or a stray line."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

MODES = ("spread", "one point", "one line", "exact", "on a grid")


def table(rng):
    """Text of a readings file with random features: too many, degenerate, contradictory, with and without normals."""
    mode = rng.choice(MODES)
    with_normals, with_directions = rng.random() < 0.3, rng.random() < 0.6
    head = ["x_mm", "y_mm", "z_mm", "feature", "kind"]
    head += ["nx", "ny", "nz", "normal_sd_deg"] * with_normals + ["dx", "dy", "dz"] * with_directions
    head += ["status", "max_mm"] * with_directions
    lines = [",".join(head)]
    for number, kind in enumerate(rng.choice(["plane", "edge", "vertex"], size=rng.integers(1, 6))):
        spread = rng.normal(size=(3, 3)) * 20
        spread[{"plane": 2, "edge": 1, "vertex": 0}[kind] :] = 0
        spread[{"one point": 0, "one line": 1}.get(mode, 3) :] = 0
        noise = 0.0 if mode == "exact" else 0.1
        base, normal = rng.normal(size=3) * 30, rng.normal(size=3)
        for _ in range(rng.integers({"plane": 3, "edge": 2, "vertex": 1}[kind], 7)):
            p = base + rng.normal(size=3) @ spread + noise * rng.normal(size=3)
            p = np.round(p / 20) * 20 if mode == "on a grid" else p
            cells = [*map(repr, p.tolist()), f"F{number}", kind]
            cells += [*map(repr, normal.tolist()), "2"] * with_normals
            # mostly into the material, sometimes not
            cells += [*map(repr, (-normal + 0.7 * rng.normal(size=3)).tolist())] * with_directions
            cells += ["ok", "500"] * with_directions
            lines.append(",".join(cells))
    if with_directions:
        blank = [""] * 2 + [""] * 4 * with_normals
        lines.append(",".join(["0", "0", "500", *blank, "0", "0", "1", "none", "400"]))
    return "\n".join(lines) + "\n"


QUICK = (1, 3, 11, 14, 24, 36)
"""Seeds whose answers take up to two seconds: one or two of each mode. The other seeds run with the slow tests."""


@pytest.mark.parametrize("seed", [k if k in QUICK else pytest.param(k, marks=pytest.mark.slow) for k in range(40)])
def test_an_answer_or_a_message(run, tmp_path, parts, seed):
    rng = np.random.default_rng(seed)
    (tmp_path / "r.csv").write_text(table(rng))
    options = [word for word in ("--robot xarm", "--form-sd 0.1mm", "--as-published") if rng.random() < 0.2]
    args = ["--sd", str(rng.choice(["1um", "0.1mm", "5mm"])), *" ".join(options).split()]
    result = run("identify", tmp_path / "r.csv", "--parts", parts, "--units", "mm", "--json", *args)
    assert result.code in (0, 1, 3)
    if result.code == 1:
        assert json.loads(result.out)["message"] in result.err
        assert "error: " in result.err
        return
    document = json.loads(result.out, parse_constant=pytest.fail)
    assert (document["status"] == "recognized") == (result.code == 0)
    probabilities = [h["probability"] for h in document["hypotheses"]]
    assert all(b <= a * (1 + 2e-3) for a, b in pairwise(probabilities))  # twins are equal to rounding
    assert 0 <= document["unknown_probability"] <= 1
    assert sum(probabilities) + document["unknown_probability"] < 1 + 1e-9
    assert document["message"]
    plain = run("identify", tmp_path / "r.csv", "--parts", parts, "--units", "mm", *args)
    assert plain.code == result.code
    assert document["message"] in plain.out
