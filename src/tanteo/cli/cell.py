"""Implement ``tanteo check-cell``: test the stated errors of a cell with readings of a known part."""

from __future__ import annotations

import math
from typing import Any

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli.answer import read_given
from tanteo.cli.answer_options import Options
from tanteo.cli.printing import complain, emit, layout, leave, put, warned
from tanteo.cli.readings import FileOptions
from tanteo.errors import InputError

_JOINT_SD = math.radians(0.1)
"""Default standard deviation of a joint's zero: that of an arm without calibration [rad]."""
_WIDE = 0.02, math.radians(10.0)
"""Standard deviations of the nearly uninformative prior around the estimated pose of the part [m, rad]."""


def check_cell(
    readings: args.ReadingsPath, part: args.PartPath, options: Options, file: FileOptions, *,
    arm: args.ArmPath = None, joints: args.JointAngles = None, joint_sd: args.JointSd = _JOINT_SD,
) -> None:  # fmt: skip
    """Test the stated errors of a cell with readings of a known part.

    Tests the errors of tip, mounting, base, bias and joint zeros, and proposes the next reading.
    """
    import numpy as np

    from tanteo.planning import Sensing, begin, check_cell, update
    from tanteo.planning.start import at_pose
    from tanteo.recognition import identify

    given = read_given(readings, [part], options, file)
    shared = (*options.shared_errors, *_joint_zeros(given.readings, arm, joints, joint_sd))
    how: dict[str, Any] = {
        "sensor": options.sensor, "robot": options.robot, "sd": options.sd, "tip_sd": options.tip_sd,
        "shared_errors": shared, "rig": given.rig, "tolerance": options.form_sd,
    }  # fmt: skip
    sensing = Sensing(**how)
    target = posterior.prepare(given.parts[0])
    if options.pose_prior is not None:
        start = at_pose(target, options.pose_prior.T, options.pose_prior.C)
    else:
        found = identify(given.readings, [given.parts[0]], **how, seed=options.seed)
        if not found.hypotheses:
            raise InputError(f"{readings}: expected readings of {given.parts[0].name}, got others. {found.message}")
        start = at_pose(target, found.hypotheses[0].T_world_part, np.diag(np.repeat(_WIDE, 3)) ** 2)
        if found.status != "recognized":
            complain("warning", f"the part is {found.status}: {found.message}")
    state = update(begin(start), *sensing.touches(given.readings))
    check = check_cell(state, given.readings, sensing.measured)
    if options.json:
        put(io.documents.document_json(_document(check), warned()))
    else:
        emit(render.text.cell_lines(check, layout=layout()))
    leave(decided=not any(error.contradicted for error in check.errors))


def _joint_zeros(readings: Any, arm: str | None, joints: str | None, sd: float) -> tuple[Any, ...]:
    """Return the zero errors of the joints of the stated arm; none without an arm."""
    from tanteo.io.documents.arm_file import read_arm, read_joints
    from tanteo.sensors.joints import joint_zeros

    if arm is None and joints is None:
        return ()
    if arm is None or joints is None:
        given, missing = ("--joints", "--arm") if arm is None else ("--arm", "--joints")
        raise InputError(f"{missing}: expected it with {given}, got none. The axes follow from arm and joint angles.")
    return joint_zeros(read_arm(arm), read_joints(joints), sd, readings.Ts_world_hand.values)


def _document(check: Any) -> dict[str, Any]:
    """Return the result as a JSON document in SI units."""
    errors = [
        {
            "name": e.name, "meaning": e.meaning, "stated_sd": e.stated, "estimate": e.estimate, "sd": e.sd,
            "p_value": e.p_value, "explained": e.explained, "contradicted": e.contradicted,
        }
        for e in check.errors
    ]  # fmt: skip
    one = check.following
    following = None if one is None else {
        "point_m": one.point, "direction": one.direction, "face": one.face, "turn_rad": one.turn, "axis": one.axis,
        "gain_nats": one.gain,
    }  # fmt: skip
    correlated = [{"one": a, "other": b, "correlation": r} for a, b, r in check.correlated]
    return {"schema": "tanteo.cell/1", "errors": errors, "correlated": correlated, "next": following}
