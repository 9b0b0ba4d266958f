"""Options for what is known beforehand, most of all of the pose: for every command that searches for a part."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tanteo.cli.options import MisuseError, misuse
from tanteo.cli.printing import complain

if TYPE_CHECKING:
    from tanteo.answers import PosePrior
    from tanteo.io import Brand
    from tanteo.typing import FloatArray

_FIELDS = {"T_world_part": "--pose-prior", "covariance": "--pose-prior", "box": "--box", "table": "--table"}


def read_pose_prior(table: str | None, box: str | None, pose_prior: str | None, file: str | None) -> PosePrior | None:
    """What the four options say together; None if none is given.

    Args:
        table: of ``--table``.
        box: of ``--box``.
        pose_prior: of ``--pose-prior``.
        file: of ``--prior``.

    Raises:
        MisuseError: an option cannot be meant, or says again what the file says.
        InputError: the file cannot be read.
    """
    if table is box is pose_prior is file is None:
        return None
    from tanteo.answers import PosePrior
    from tanteo.io import BRANDS, parse_box, parse_pose_prior, parse_table, prior_brand, read_prior

    with misuse():
        frame = None if pose_prior is None else parse_pose_prior(pose_prior, "--pose-prior")
        _say_if_unverified(
            "--pose-prior", BRANDS.get(pose_prior.split(maxsplit=1)[0].rstrip(":")) if pose_prior else None
        )
        typed = PosePrior(
            T_world_part=None if frame is None else frame.T,
            covariance=None if frame is None else frame.C,
            box=None if box is None else parse_box(box, "--box"),
            table=None if table is None else parse_table(table, "--table"),
        )
    if file is None:
        return typed
    given = {name: value for name in _FIELDS if (value := getattr(typed, name)) is not None}
    read = read_prior(file)
    _say_if_unverified(f"{file}, near", prior_brand(file))
    for name in given:
        if getattr(read, name) is not None:
            raise MisuseError(f"{_FIELDS[name]}: expected it once, got it in {file} too. Keep one.")
    return replace(read, **given)


def _say_if_unverified(place: str, brand: Brand | None) -> None:
    """Warn of a brand whose convention nobody has read in its documentation."""
    if brand is not None and not brand.verified:
        complain(
            "warning",
            f"{place}: the angle convention of {brand.name} ({' '.join(brand.fields)}) was not checked against its "
            "documentation. Compare one pose with the answer, or give roll, pitch, yaw.",
        )


def prior_words(prior: PosePrior) -> str:
    """What is taken as known, for a person."""
    words = (_table_words(prior), _box_words(prior), _near_words(prior))
    return "; ".join(text for text in words if text)


def _table_words(prior: PosePrior) -> str:
    if prior.table is None:
        return ""
    (x, y, z), n = 1e3 * prior.table.point, prior.table.normal
    where = f"z {z:.6g} mm" if n[2] == 1 else f"({x:.6g}, {y:.6g}, {z:.6g}) mm, normal ({_numbers(n, 4)}),"
    return f"rests on a table at {where} (sd {1e3 * prior.table.sd:.3g} mm)"


def _box_words(prior: PosePrior) -> str:
    if prior.box is None:
        return ""
    low, high = 1e3 * prior.box
    return f"in the box from ({_numbers(low)}) to ({_numbers(high)}) mm"


def _near_words(prior: PosePrior) -> str:
    if prior.T_world_part is None or prior.covariance is None:
        return ""
    import numpy as np

    from tanteo.io import pose_as_brand

    place = pose_as_brand("paper", prior.T_world_part)
    sds = [np.sqrt(np.linalg.eigvalsh(block)[-1]) for block in (prior.covariance[:3, :3], prior.covariance[3:, 3:])]
    return (
        f"near ({_numbers(1e3 * place[:3])}) mm, roll pitch yaw ({_numbers(np.degrees(place[3:]))}) deg "
        f"(sd up to {1e3 * sds[0]:.3g} mm, {np.degrees(sds[1]):.3g} deg)"
    )


def _numbers(values: FloatArray, digits: int = 6) -> str:
    return ", ".join(f"{v + 0.0:.{digits}g}" for v in values)
