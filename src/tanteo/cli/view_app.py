"""``tanteo view``. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.arguments import (
    CameraFile,
    Confidence,
    Feature,
    ImageFile,
    MarksFile,
    MaxMeasurements,
    OutlierRate,
    PolicyName,
    PosePriorAt,
    PriorPath,
    Probability,
    SceneSeed,
    Units,
    UnknownPrior,
    Within,
)


def view(
    record: Annotated[
        str | None, typer.Argument(metavar="[RECORD]", help="Record of a session (JSON), to be seen step by step.")
    ] = None,
    scene: Annotated[
        str | None, typer.Option("--scene", metavar="FILE", help="Scene: parts, table, hand (TOML); else an example.")
    ] = None,
    parts: Annotated[
        list[str] | None,
        typer.Option("--parts", metavar="FILE_OR_FOLDER...", help="CAD files (STEP, STL) or folders of them."),
    ] = None,
    bare: Annotated[bool, typer.Option("--bare", help="No hand: a laser that is simply where it is wanted.")] = False,
    policy: PolicyName = "information",
    probability: Probability = 0.99,
    tolerance: Within = None,
    feature: Feature = None,
    confidence: Confidence = 0.95,
    max_measurements: MaxMeasurements = 100,
    standoff: Annotated[
        str | None,
        typer.Option("--standoff", metavar="LENGTH", help="Of the sensors, as 40mm; else the scene's."),
    ] = None,
    units: Units = None,
    pose_prior: PosePriorAt = None,
    prior: PriorPath = None,
    outlier_rate: OutlierRate = None,
    unknown_prior: UnknownPrior = None,
    image: ImageFile = None,
    camera: CameraFile = None,
    marks: MarksFile = None,
    seed: SceneSeed = None,
    port: Annotated[int, typer.Option("--port", help="Of the page on this machine; else the next free one.")] = 8080,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in a browser.")] = False,
) -> None:
    """Show a session as it happens in a browser, and sense there yourself; or a record, step by step."""
    from tanteo.cli.image_start import image_options
    from tanteo.cli.options import misuse
    from tanteo.cli.prior_options import read_pose_prior
    from tanteo.cli.running import guarded
    from tanteo.cli.sensing_part import read_part_options
    from tanteo.cli.viewing import check_view, require_viser, view_record, view_scene

    with guarded():
        with misuse():
            of_session = {
                "--bare": bare, "--tolerance": tolerance, "--feature": feature, "--standoff": standoff,
                "--pose-prior": pose_prior,
                "--prior": prior, "--outlier-rate": outlier_rate, "--unknown-prior": unknown_prior, "--image": image,
                "--camera": camera,
                "--marks": marks, "--seed": seed is not None,
            }  # fmt: skip
            check_view(record, scene, parts or [], port, of_session)
            options = read_part_options(
                policy=policy, probability=probability, tolerance=tolerance, confidence=confidence, feature=feature,
                max_measurements=max_measurements, standoff=standoff, seed=seed, units=units,
                outlier_rate=outlier_rate, unknown_prior=unknown_prior,
            )  # fmt: skip
        require_viser()
        if record is not None:
            view_record(record, parts or [], port, show=not no_open)
            return
        known = read_pose_prior(None, None, pose_prior, prior)
        seen = image_options(image, camera, marks)
        view_scene(scene, parts or [], options, known, seen, port, bare=bare, show=not no_open)
