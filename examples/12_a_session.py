"""Run a session that chooses readings until one of three parts is identified and located.

A feeder drops a bracket, its mirror image or a wedge within about 15 mm and 10 degrees. A laser with 0.3 mm noise makes
the readings that the session chooses. This example computes its ranges from the true pose; a real sensor would measure
them. The session is saved after every reading, so that it can continue after an interruption. At the end the example
prints the information of each reading.

    python examples/12_a_session.py
"""

import tempfile
from pathlib import Path

import numpy as np

from tanteo.geometry import SE3
from tanteo.io import read_record, write_record
from tanteo.parts import read_part
from tanteo.planning import Action, Probe, Sensing, Session, Stop, at_place
from tanteo.planning.explanation import explain
from tanteo.posterior import prepare
from tanteo.sensors.presets import NoiseLaw

folder = Path(__file__).parent / "parts"
targets = [prepare(read_part(folder / f"{name}.step")) for name in ("bracket_left", "bracket_right", "wedge")]
rough = np.diag([0.015, 0.015, 0.015, 0.17, 0.17, 0.17]) ** 2
start = at_place(targets, SE3.exp(np.array([0.4, -0.1, 0.05, 0.0, 0.0, 0.5])), rough)
laser = Probe("laser", NoiseLaw.of(3e-4), max_range=0.3, standoff=0.1)

rng = np.random.default_rng(12)
T_world_part = start.Ts[1] @ SE3.exp(np.linalg.cholesky(start.covariances[1]) @ rng.normal(size=6))
to_part = SE3.inverse(T_world_part)  # true pose: a right bracket in the feeder

session = Session(start, laser, Sensing(sd=3e-4), stop=Stop(tolerance=2e-3))
record = Path(tempfile.mkdtemp()) / "session.json"
while isinstance(action := session.ask(), Action):
    origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
    distance = float(targets[1].surface.cast(origin[None], along[None]).distances[0])
    session.tell(action.read(distance + 3e-4 * rng.normal()))
    write_record(session, record)
print(action.message)
print(f"{session.answer().status}: {session.answer().message}")

explanation = explain(session.state, session.steps)
for added in explanation.added:
    print(
        f"{added.ids[0]} hit {added.faces[0]}: {added.about_part:.2f} nats about the part, "
        f"most probable is {added.part or 'none'}"
    )
    print(f"   largest corner sd {1e3 * added.corner_sd:.2f} mm; most reduced: {added.motion or 'no motion'}")
worst = explanation.directions[0]
print(
    f"most uncertain: {worst.motion}, {1e3 * worst.moves:.2f} mm at the corners, most of it from {worst.shares[0][0]}"
)

again = read_record(record, targets)
print(f"the record restores exactly the same posterior: {np.array_equal(again.state.poses, session.state.poses)}")
