"""Define the options of a probe and of what it can reach: workspace, obstacles, tool and approach."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tanteo import io
from tanteo.cli import arguments as args

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tanteo.cli.answer_options import Evidence
    from tanteo.cli.probing import ProgramOptions
    from tanteo.hand import Workspace
    from tanteo.planning import Probe
    from tanteo.posterior import PosePrior, Table

_TYPICAL = 1e-4
"""Standard deviation of a touch if neither the readings nor the user state it [m]."""

_UPWARD = 0.1
"""Smallest vertical component of an earlier approach from below, after which another one may be named."""

_DOWN, _UP = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
"""Direction of an approach from above, and from the ball to the holder of an upright tool."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachOptions:
    """Options of a probe's approach and of what it must not touch."""

    workspace: args.WorkspaceBox = None
    forbid: args.Forbid = None
    tool_body: args.ToolBody = None
    tool_tilt: args.ToolTilt = None
    axis_parallel: args.AxisParallel = False
    approach: args.Approach = None
    standoff: args.TouchStandoff = None
    clearance: args.Clearance = None

    def limits(self, table: Table | None = None) -> Workspace:
        """Return the permitted positions, which are above a known table.

        Args:
            table: level table under the part; None if not known.
        """
        import numpy as np

        from tanteo.hand import Workspace

        low, high = (np.full(3, -np.inf), np.full(3, np.inf)) if self.workspace is None else self.workspace
        if table is not None:
            low = np.array([*low[:2], max(low[2], float(table.frame[2, 3]))])
        return Workspace(low, high, tuple(self.forbid or ()))

    def where(
        self,
        table: Table | None,
        furniture: Sequence[str] | None,
        units: str | None,
        *,
        ball: float,
        above: bool,
        upright: bool = False,
    ) -> dict[str, Any]:
        """Return the fields of :class:`tanteo.Probe` that these options state.

        Args:
            table: level table under the part; None if not known.
            furniture: values of ``--furniture``; None if not given.
            units: value of ``--units``; None if not given.
            ball: radius of the probe's ball [m].
            above: whether the probe approaches from above or the side, unless ``--approach`` is given.
            upright: whether the stylus always points down, as that of a milling machine.
        """
        from tanteo.machines import tool_body

        known = [io.poses.read_furniture(text, units, "--furniture") for text in furniture or ()]
        stated: dict[str, Any] = {
            "standoff": self.standoff, "clearance": self.clearance, "workspace": self.limits(table),
            "axis_parallel": self.axis_parallel, "obstacles": tuple(one.surface for one in known),
            "body": None if self.tool_body is None else tool_body(self.tool_body[0], ball, *self.tool_body[1:]),
        }  # fmt: skip
        if self.approach is not None:
            stated |= dict(zip(("approach", "cone"), self.approach, strict=True))
        elif above or table is not None or self.axis_parallel:
            stated |= {"approach": _DOWN, "cone": math.pi / 2}
        if self.tool_tilt == 0 or upright:
            stated |= {"stylus": _UP}
        elif self.tool_tilt is not None or self.tool_body is not None:
            stated |= {"stylus_along_motion": True, "tilt": math.pi if self.tool_tilt is None else self.tool_tilt}
        return {name: value for name, value in stated.items() if value is not None}


def probe_for(
    given: Any,
    options: Evidence,
    reach: ReachOptions,
    known: PosePrior | None,
    program: ProgramOptions | None = None,
) -> Probe:
    """Return the sensor of a further reading like those of a file.

    Args:
        given: inputs with their ``readings`` and ``measured`` points.
        options: options of the answer.
        reach: limits of the approach.
        known: prior knowledge of the pose; a known table bounds the approach.
        program: options of the probing program; None without one.
    """
    import numpy as np

    from tanteo.planning import probe_of
    from tanteo.sensors.presets import sensor_preset

    readings, measured = given.readings, given.measured
    beam = bool(readings.ranges.given.any()) if options.sensor is None else not (
        sensor_preset(options.sensor).is_contact
    )  # fmt: skip
    where = {} if program is None else program.of_probe(beam=beam, turned=reach.tool_tilt != 0)
    ball = float(readings.radii.max(initial=0.0)) if not beam else 0.0
    if not beam:
        where = {"contact": True, "radius": ball} | where
    directions = measured.directions[np.isfinite(measured.directions).all(axis=1)]
    above = bool((directions[:, 2] <= _UPWARD).all())  # also without directions: few machines touch from below
    table = known.table if known is not None else None
    where |= reach.where(table, options.furniture, options.units, ball=ball, above=above, upright="stylus" in where)
    where["form_sd"] = options.form_sd
    sd = options.sd
    if options.sensor is None and sd is None:
        along = np.einsum("nii->n", measured.covs) / 3
        sd = float(np.sqrt(np.median(along))) if len(along) else _TYPICAL
    return probe_of(options.sensor or sd or _TYPICAL, options.robot, **where)
