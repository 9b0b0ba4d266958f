"""Write FANUC TP programs: ``SKIP CONDITION`` with ``Skip,LBL[n],PR[m]=LPOS``, which jumps if there is no contact.

The commands follow published programs. Position registers keep the position of the skip (option High-Speed Skip).
"""

from __future__ import annotations

import textwrap

from tanteo.geometry.typing import Rotations, Vectors
from tanteo.machines.programs.job import TRAVEL, Job
from tanteo.machines.programs.robot import pose_text, robot_header, ways


def fanuc(job: Job) -> str:
    """Return the TP program of a job; it stores contacts in position registers from 101 on.

    Args:
        job: touches of the program.
    """
    log = [f"log: PR[101] to PR[{100 + len(job.touches)}], X Y Z of the ball's centre in millimetres"]
    log += ["PR=LPOS at the skip needs the option High-Speed Skip. All positions have CONFIG N U T"]
    steps = [f"!{row}" for text in robot_header(job, log) for row in textwrap.wrap(text, 30)]
    steps += ["UFRAME_NUM=0", "UTOOL_NUM=1", "SKIP CONDITION DI[1]=ON"]
    poses: list[str] = []

    def point(place: Vectors, tool: Rotations) -> int:
        poses.append(_position(len(poses) + 1, pose_text("fanuc", place, tool)))
        return len(poses)

    for touch, way in ways(job):
        steps.append(f"!touch {touch.number}: {touch.face[:16]}")
        steps += [f"L P[{point(place, tool)}] {1e3 * TRAVEL:g}mm/sec FINE" for place, tool in way]
        start, stop = (point(place, touch.tool) for place in (touch.start, touch.stop))
        steps += ["IF DI[1]=ON,JMP LBL[998]", f"L P[{start}] 50mm/sec FINE", "IF DI[1]=ON,JMP LBL[998]"]
        steps += [f"L P[{stop}] {max(1e3 * job.feed, 0.1):.1f}mm/sec FINE Skip,LBL[999],PR[{100 + touch.number}]=LPOS"]
        steps += [f"L P[{start}] 50mm/sec FINE", f"L P[{len(poses) - 2}] {1e3 * TRAVEL:g}mm/sec FINE"]
    steps += ["END", "LBL[998:HIGH]", "MESSAGE[PROBE IS HIGH]", "ABORT"]
    steps += ["LBL[999:NOTHING]", "MESSAGE[NO CONTACT]", "ABORT"]
    body = [f"{n:4d}:  {step} ;" for n, step in enumerate(steps, 1)]
    top = ["/PROG  TANTEO", "/ATTR", 'COMMENT\t\t= "TANTEO";', "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    return "\n".join([*top, *body, "/POS", *poses, "/END", ""])


def _position(number: int, fields: str) -> str:
    place, turn = fields.split(", W = ")
    lines = [f"P[{number}]{{", "   GP1:", "\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',"]
    return "\n".join([*lines, f"\t{place},", f"\tW = {turn}", "};"])
