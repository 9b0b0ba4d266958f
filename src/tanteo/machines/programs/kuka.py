"""Write KUKA KRL programs: an interrupt ends the search motion and stores the position; the second file is the log.

``RESUME`` ends the subprograms below the one that declares the interrupt and needs ``$ADVANCE`` 0 (articles on the KRL
reference). The program has not been run on a controller.
"""

from __future__ import annotations

from tanteo.geometry.typing import Rotations, Vectors
from tanteo.machines.programs.job import TRAVEL, Job
from tanteo.machines.programs.robot import pose_text, robot_header, ways


def kuka(job: Job) -> str:
    """Return the KRL program of a job: two files, of which the second (``.dat``) is the log.

    Args:
        job: touches of the program.
    """
    log = [
        "two files: save the text below the line of dashes as TANTEO.DAT beside TANTEO.SRC",
        "log: FOUND[1].. of TANTEO.DAT after the run, positions of the ball's centre in millimetres",
        "the search by interrupt was not verified: try it on the controller with a hand on the stop",
    ]
    lines = ["&ACCESS RVP", "DEF TANTEO( )", *(f"; {text}" for text in robot_header(job, log)), *_KRL.splitlines()]
    for touch, way in ways(job):
        lines.append(f"; touch {touch.number}: {touch.face}")
        lines += [f"LIN {_frame(place, tool)}" for place, tool in way]
        places = [f"{name}={_frame(p, touch.tool)}" for name, p in (("P_START", touch.start), ("P_GOAL", touch.stop))]
        lines += [*places, f"TOUCH({touch.number})", f"LIN {_frame(touch.outer, touch.tool)}"]
    lines += ["END", "", *_KRL_SEARCH.format(feed=job.feed).splitlines(), "; " + 40 * "-", "DEFDAT TANTEO PUBLIC"]
    lines += ["DECL INT TOUCH_NO=0", "DECL BOOL MET=FALSE", "DECL FRAME P_START", "DECL FRAME P_GOAL"]
    lines += [f"DECL FRAME FOUND[{len(job.touches)}]"]
    zero = "{X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}"
    return "\n".join([*lines, *(f"FOUND[{t.number}]={zero}" for t in job.touches), "ENDDAT", ""])


def _frame(place: Vectors, tool: Rotations) -> str:
    return pose_text("kuka", place, tool)


_KRL = f"""BAS(#INITMOV,0)
$ADVANCE=0
$BASE=$NULLFRAME
$TOOL=TOOL_DATA[1]
$VEL.CP={TRAVEL}"""

_KRL_SEARCH = """DEF TOUCH(N:IN)
INT N
TOUCH_NO=N
MET=FALSE
$VEL.CP=0.05
IF $IN[1] THEN
HALT ; the probe is high before the touch
ENDIF
LIN P_START
WAIT SEC 0
IF $IN[1] THEN
HALT ; the probe touched something on the way
ENDIF
SEARCH()
IF NOT MET THEN
HALT ; no contact
ENDIF
$VEL.CP=0.05
LIN P_START
$VEL.CP=0.1
END

DEF SEARCH()
INTERRUPT DECL 20 WHEN $IN[1]==TRUE DO CONTACT()
SEARCH_MOTION()
END

DEF SEARCH_MOTION()
INTERRUPT ON 20
$VEL.CP={feed:.6f}
LIN P_GOAL
WAIT SEC 0
INTERRUPT OFF 20
END

DEF CONTACT()
INTERRUPT OFF 20
BRAKE F
FOUND[TOUCH_NO]=$POS_INT
MET=TRUE
RESUME
END
"""
