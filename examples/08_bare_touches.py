"""Identify a part from unlabelled contact points, without an initial pose.

Readings without a ``feature`` label are compared with the whole surface of every part. The search proposes positions of
three readings all over the surface and refines the best poses with all readings. Each reading is on the surface or an
outlier. Twelve touches of the bracket are enough here. Directions of approach help, because a probe touches a surface
from outside. They matter more if there are fewer readings or the parts are more similar.

    python examples/08_bare_touches.py
"""

from pathlib import Path

import tanteo
from tanteo.sensors import Readings

HERE = Path(__file__).parent
parts = tanteo.read_parts(HERE / "parts").parts
touches = tanteo.read_readings(HERE / "readings" / "bracket_bare.csv")

for n in (12, 8):
    for directed in (True, False):
        some = Readings.from_columns(
            touches.points[:n], directions=touches.directions[:n] if directed else None, sds=touches.sds[:n]
        )
        answer = tanteo.identify(some, parts)
        word = "with" if directed else "without"
        print(f"{n} touches {word} directions: {answer.status}. {answer.message}")
