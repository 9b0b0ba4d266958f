"""``tanteo sense``: its commands and their options. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.arguments import (
    CameraFile,
    Confidence,
    Feature,
    Grouped,
    ImageFile,
    Json,
    MarksFile,
    MaxMeasurements,
    OutlierRate,
    PolicyName,
    PosePriorAt,
    PriorPath,
    Probability,
    Report,
    SceneSeed,
    Units,
    UnknownPrior,
    Verbose,
    Within,
)

sense_app = typer.Typer(
    help="Sense a feature, or find out which part is there, in the simulator, without contact.",
    rich_markup_mode=None,
    no_args_is_help=True,
)

SceneFile = Annotated[str, typer.Option("--scene", metavar="FILE", help="Scene: parts, table, hand (TOML).")]
Standoff = Annotated[
    str | None, typer.Option("--standoff", metavar="LENGTH", help="Of the hand's front, as 20mm; else the scene's.")
]
Record = Annotated[str | None, typer.Option("--record", metavar="FILE", help="Write the readings (CSV).")]
Forbid = Annotated[
    list[str] | None,
    typer.Option(
        "--forbid", metavar="CORNERS", help="Box to stay out of: two corners, as 150,0,0,180,60,250mm; may be repeated."
    ),
]
IdeaParts = Annotated[
    list[str] | None,
    typer.Option("--parts", metavar="FILE_OR_FOLDER...", help="CAD files that --image may show, or folders of them."),
]
FaceName = Annotated[
    str | None,
    typer.Option("--face", metavar="NAME", help="Of the part in --image, as 'face 6' (see tanteo part show)."),
]


@sense_app.command("plane", cls=Grouped)
def sense_plane(
    scene: SceneFile,
    standoff: Standoff = None,
    seed: SceneSeed = None,
    record: Record = None,
    forbid: Forbid = None,
    parts: IdeaParts = None,
    image: ImageFile = None,
    camera: CameraFile = None,
    marks: MarksFile = None,
    face: FaceName = None,
    units: Units = None,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Acquire a flat face without touching it."""
    guess = parts, image, camera, marks, face, units
    _sense("plane", scene, standoff, seed, record, forbid or [], guess, json, verbose)


@sense_app.command("edge", cls=Grouped)
def sense_edge(
    scene: SceneFile,
    standoff: Standoff = None,
    seed: SceneSeed = None,
    record: Record = None,
    forbid: Forbid = None,
    parts: IdeaParts = None,
    image: ImageFile = None,
    camera: CameraFile = None,
    marks: MarksFile = None,
    face: FaceName = None,
    units: Units = None,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Acquire a straight edge, and its face, without touching them."""
    guess = parts, image, camera, marks, face, units
    _sense("edge", scene, standoff, seed, record, forbid or [], guess, json, verbose)


@sense_app.command("vertex", cls=Grouped)
def sense_vertex(
    scene: SceneFile,
    standoff: Standoff = None,
    seed: SceneSeed = None,
    record: Record = None,
    forbid: Forbid = None,
    parts: IdeaParts = None,
    image: ImageFile = None,
    camera: CameraFile = None,
    marks: MarksFile = None,
    face: FaceName = None,
    units: Units = None,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Acquire a corner, its face and two edges, without touching them."""
    guess = parts, image, camera, marks, face, units
    _sense("vertex", scene, standoff, seed, record, forbid or [], guess, json, verbose)


@sense_app.command("part", cls=Grouped)
def sense_part(
    scene: SceneFile,
    parts: Annotated[
        list[str],
        typer.Option("--parts", metavar="FILE_OR_FOLDER...", help="CAD files (STEP, STL) or folders of them."),
    ],
    policy: PolicyName = "information",
    probability: Probability = 0.99,
    tolerance: Within = None,
    feature: Feature = None,
    confidence: Confidence = 0.95,
    max_measurements: MaxMeasurements = 100,
    standoff: Standoff = None,
    units: Units = None,
    pose_prior: PosePriorAt = None,
    prior: PriorPath = None,
    outlier_rate: OutlierRate = None,
    unknown_prior: UnknownPrior = None,
    image: ImageFile = None,
    camera: CameraFile = None,
    marks: MarksFile = None,
    seed: SceneSeed = None,
    record: Annotated[
        str | None,
        typer.Option("--record", metavar="FILE", help="Write the session (JSON), or its readings (.csv)."),
    ] = None,
    report: Report = None,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Find out which part is there and where, from a rough idea of its place, by range sensors on a hand."""
    from tanteo.cli.image_start import image_options
    from tanteo.cli.options import misuse
    from tanteo.cli.prior_options import read_pose_prior
    from tanteo.cli.running import guarded
    from tanteo.cli.sensing_part import read_part_options, sense_unknown

    with guarded():
        with misuse():
            options = read_part_options(
                policy=policy, probability=probability, tolerance=tolerance, confidence=confidence, feature=feature,
                max_measurements=max_measurements, standoff=standoff, seed=seed, units=units,
                outlier_rate=outlier_rate, unknown_prior=unknown_prior,
            )  # fmt: skip
        known = read_pose_prior(None, None, pose_prior, prior)
        seen = image_options(image, camera, marks)
        sense_unknown(scene, parts, options, known, seen, record, report, as_json=json, verbose=verbose)


def _sense(
    kind: str,
    scene: str,
    standoff: str | None,
    seed: int | None,
    record: str | None,
    forbid: list[str],
    guess: tuple[list[str] | None, str | None, str | None, str | None, str | None, str | None],
    json: bool,
    verbose: bool,
) -> None:
    from tanteo.cli.image_guess import guess_options
    from tanteo.cli.running import guarded
    from tanteo.cli.sensing import sense

    with guarded():
        seen = guess_options(*guess)
        sense(
            kind, scene, standoff=standoff, seed=seed, record=record, forbid=forbid, image=seen, as_json=json,
            verbose=verbose,
        )  # fmt: skip
