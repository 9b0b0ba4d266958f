"""Recognizing and locating real parts of about sixty planes from six of them, alone and among fifty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bench_identify import sense
from common import Table, seconds

from tanteo.catalogue import read_parts
from tanteo.posterior import identify_features, prepare

DATA = Path(__file__).parents[2] / "shared" / "data"
PLANES = (52, 70)
"""Parts with as many planes as that stand for "about sixty"."""

COUNT, AMONG, SCENES = 6, 50, 3
ALONE_TARGET, AMONG_TARGET = 20.0, 500.0

TEXT = f"""\
As above, on real STEP parts (`step_parts` and `step_nist`) with {PLANES[0]} to {PLANES[1]} planes, prepared beforehand:
{COUNT} planes, {SCENES} scenes a part, drawn from the faces that are large enough for a probe (standard deviations
of the face of 1 mm or more). The part alone (aim: {ALONE_TARGET:g} ms), among {AMONG} (aim: {AMONG_TARGET:g} ms)."""


def measure() -> Table:
    columns = ("", "scenes", "milliseconds, median", "90 %", "worst", "true part first")
    folders = [DATA / name for name in ("step_parts", "step_nist")]
    if not all(folder.is_dir() for folder in folders):
        return Table("Identifying parts of sixty planes", f"{TEXT}\n\nNot measured: {DATA} is missing.", columns, [])
    models = [prepare(part) for part in read_parts(folders).parts]
    alone, among, right = [], [], [0, 0]
    for model in models:
        if not PLANES[0] <= len(model.part.planes) <= PLANES[1]:
            continue
        felt = np.flatnonzero(model.part.planes.gyration[:, 1] >= 1e-3)
        if len(felt) < COUNT:
            continue
        fifty = [model, *(other for other in models if other is not model)][:AMONG]
        for scene in range(SCENES):
            features = sense(model.part, COUNT, np.random.default_rng(scene), felt)
            for k, (given, times) in enumerate((([model], alone), (fifty, among))):
                answer = identify_features(features, given)
                right[k] += bool(answer.hypotheses) and answer.hypotheses[0].part == model.name
                times.append(
                    1e3 * seconds(lambda f=features, g=given: identify_features(f, g), repeats=3, at_least=1e-3)
                )
    rows = [
        (
            name,
            str(len(times)),
            *(f"{np.quantile(times, q):.3g}" for q in (0.5, 0.9, 1.0)),
            f"{hits} of {len(times)}",
        )
        for name, times, hits in (("alone", alone, right[0]), (f"among {AMONG}", among, right[1]))
    ]
    return Table("Identifying parts of sixty planes", TEXT, columns, rows)
