"""Two result documents: the same, the same up to rounding, or not."""

from __future__ import annotations

import copy

from tanteo.io.documents import differences

THEN = {
    "version": "0.1.0", "status": "recognized", "unknown_probability": 0.125, "elapsed_s": {"total": 1.0},
    "hypotheses": [{"part": "a", "file": "x", "rms_m": None, "pose": [[1.0, 0.0], [0.25, 3]]}],
}  # fmt: skip


def changed(**values):
    out = copy.deepcopy(THEN)
    out["hypotheses"][0] |= {k: v for k, v in values.items() if k not in out}
    return out | {k: v for k, v in values.items() if k in out}


def test_versions_files_and_times_do_not_count():
    assert differences(THEN, changed(version="2", file="y", elapsed_s={"load": 2.0})) == ((), True)


def test_the_last_bit_is_seen_and_is_no_difference():
    assert differences(THEN, changed(unknown_probability=0.125 * (1 + 1e-15))) == ((), False)
    assert differences(THEN, changed(pose=[[1.0, 1e-17], [0.25, 3]])) == ((), False)


def test_what_differs_is_named():
    assert differences(THEN, changed(part="b")) == (("hypotheses[0].part: 'a' then, 'b' now",), False)
    assert differences(THEN, changed(rms_m=0.0)) == (("hypotheses[0].rms_m: None then, 0.0 now",), False)
    (line,), _ = differences(THEN, changed(pose=[[1.0, 0.0], [0.2501, 3]]))
    assert line == "hypotheses[0].pose[1][0]: 0.25 then, 0.2501 now"
    assert differences(THEN, changed(hypotheses=[]))[0]
    assert differences(THEN, THEN | {"more": 1})[0]
