"""Implement ``tanteo next``: the reading that an undecided answer lacks, or that a goal needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io, render
from tanteo.cli import arguments as args
from tanteo.cli import typed
from tanteo.cli.answer import HYPOTHESES, ask
from tanteo.cli.answer_options import Evidence
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, emit, layout, leave, put, warned
from tanteo.cli.probing import ProgramOptions
from tanteo.cli.reach_options import ReachOptions, probe_for
from tanteo.cli.readings import FileOptions

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.planning import Probe
    from tanteo.planning.following import NextReading


@dataclass(frozen=True, slots=True, kw_only=True)
class Options(Evidence):
    """Options of ``next``."""

    part: Annotated[str | None, args.option("--part", "FILE", "CAD file of the part (STEP, STL, ...).")] = None
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL), folders of them, or a catalogue."),
    ] = None
    goal: args.Goal = None

    def __post_init__(self) -> None:
        if (self.part is None) == (not self.parts):
            got = "neither" if self.part is None else "both"
            raise MisuseError(f"next: expected --part FILE or --parts FILE_OR_FOLDER, got {got}. Give one.")


def next_reading(
    readings: args.ReadingsPath, options: Options, reach: ReachOptions, file: FileOptions, program: ProgramOptions
) -> None:
    """Name the next reading for a file of readings.

    It decides an ambiguous or insufficient answer, or improves the pose up to --goal.
    """
    from tanteo.planning.following import NextReading, next_reading
    from tanteo.words.findings import GoalReached

    known = typed.read_known(options.table, options.box, options.pose_prior, options.prior, options.rests)
    paths = options.parts or [options.part or ""]
    reply = ask(readings, paths, options, file, known, top=HYPOTHESES)
    answer, given = reply.answer, reply.given
    with misuse():
        probe = probe_for(given, options, reach, known, program)
    found = None
    if answer.status != "recognized" or options.goal is not None:
        found = next_reading(answer, given.parts, probe, options.goal, options.seed)
    written = _program(found, given.parts, probe, program) if isinstance(found, NextReading) else None
    if options.json:
        put(io.documents.document_json(io.documents.next_document(answer, found, written), warned()))
    else:
        emit(render.text.next_lines(answer, found, layout=layout()))
        put(written or "")
    done = isinstance(found, NextReading | GoalReached) or (answer.status == "recognized" and found is None)
    leave(decided=done)


def _program(found: NextReading, parts: Any, probe: Probe, program: ProgramOptions) -> str | None:
    """Return the program of one touch, which searches up to the farthest contact that a hypothesis expects."""
    if program.program is None:
        return None
    from tanteo.parts import part_named

    part: Part = part_named(parts, found.action.part)
    if program.overtravel is None:
        program = replace(program, overtravel=found.overtravel)
    if not found.finding.clear:
        complain("warning", "--program: the part may be in the path of the approach. Run it slowly.")
    return program.written(found.plan, part, probe, found.covariance)
