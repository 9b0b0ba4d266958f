"""``tanteo plan``. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.arguments import (
    Feature,
    Json,
    PosePriorAt,
    Report,
    robot_names,
    sensor_names,
)


def plan(
    part: Annotated[
        str | None, typer.Option("--part", metavar="FILE", help="CAD file of the part to place (STEP, STL, ...).")
    ] = None,
    discriminate: Annotated[
        list[str] | None,
        typer.Option(
            "--discriminate", metavar="A B", help="CAD files of two parts: which one reading discriminates them?"
        ),
    ] = None,
    tolerance: Annotated[
        str | None,
        typer.Option("--tolerance", metavar="LENGTH", help="How far off its corners may be, as 0.2mm."),
    ] = None,
    confidence: Annotated[
        float | None, typer.Option("--confidence", help="Probability with which they keep it: 0.95 if not said.")
    ] = None,
    feature: Feature = None,
    sensor: Annotated[
        str | None,
        typer.Option("--sensor", metavar="NAME", help="Preset with the sensor's errors.", autocompletion=sensor_names),
    ] = None,
    sd: Annotated[
        str | None,
        typer.Option("--sd", metavar="LENGTH", help="Instead: one standard deviation of a reading, as 0.1mm."),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option("--robot", metavar="PRESET", help="Preset with the robot's errors.", autocompletion=robot_names),
    ] = None,
    pose_prior: PosePriorAt = None,
    approach: Annotated[
        str | None,
        typer.Option(
            "--approach", metavar="DIR,ANGLE", help="Which way it may look or move in the world, as 0,0,-1,60deg."
        ),
    ] = None,
    standoff: Annotated[str | None, typer.Option("--standoff", metavar="LENGTH", help="From start to surface.")] = None,
    clearance: Annotated[
        str | None,
        typer.Option("--clearance", metavar="LENGTH", help="Room that the probe needs: 10mm if not said."),
    ] = None,
    max_measurements: Annotated[
        int | None, typer.Option("--max-measurements", help="Readings at most: 30 if not said.")
    ] = None,
    units: Annotated[
        str | None,
        typer.Option(
            "--units",
            metavar="UNIT",
            help="Unit of STL, OBJ, PLY and OFF: mm, cm, m, um, in, ft.",
        ),
    ] = None,
    csv: Annotated[str | None, typer.Option("--csv", metavar="FILE", help="Write the plan as a table too.")] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of the places that are tried.")] = 0,
    report: Report = None,
    json: Json = False,
) -> None:
    """Plan the fewest readings that place a part within a tolerance, or the one that discriminates two parts."""
    from tanteo.cli.options import misuse
    from tanteo.cli.plan_options import PlanOptions
    from tanteo.cli.planning import run_plan
    from tanteo.cli.running import guarded

    with guarded():
        with misuse():
            options = PlanOptions.read(
                part=part, discriminate=discriminate or [], tolerance=tolerance, confidence=confidence, feature=feature,
                sensor=sensor, sd=sd, robot=robot, pose_prior=pose_prior, approach=approach,
                standoff=standoff, clearance=clearance,
                max_measurements=max_measurements, units=units, csv=csv, seed=seed,
            )  # fmt: skip
        run_plan(options, report, as_json=json)
