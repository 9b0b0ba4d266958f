"""Unlabelled contact points: nobody noted which face each reading met, and there is no first guess of the pose.

Readings without a ``feature`` label go against the whole surface of every part. Places for three of them are tried all
over the surface, the best poses are polished with all readings, and each reading is either on the surface or an
outlier. Twelve touches of the bracket are enough here. Directions of approach help, because a surface is met from
outside; the fewer the readings and the more alike the parts, the more they matter.

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
        way = "with" if directed else "without"
        print(f"{n} touches {way} directions: {answer.status}. {answer.message}")
