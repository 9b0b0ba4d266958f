"""The table of formats: a row each, asked in this order. A format from outside is asked first."""

from __future__ import annotations

from tanteo.errors import InputError, did_you_mean
from tanteo.logs import (
    bcnc,
    cloud,
    cncprobe,
    console,
    dmis,
    fanuc,
    krl,
    ply,
    points,
    qif,
    rapid,
    results,
    tof,
    urscript,
)
from tanteo.logs.contents import Contents
from tanteo.logs.log import LogFormat

TABLE = "csv"
"""Name of the project's own format, which is a table with a header and read in ``tanteo.io``."""

FORMATS: dict[str, LogFormat] = {
    row.name: row
    for row in (
        LogFormat("ply", "a PLY point cloud", ply.recognise, ply.read),
        LogFormat("pcd", "a PCD point cloud", cloud.recognise, cloud.read),
        LogFormat("qif", "a QIF document", qif.recognise, qif.read),
        LogFormat("grbl", "a GRBL console log", console.recognise, console.read),
        LogFormat("fusion", "a probe results file (G800, G801)", results.recognise, results.read),
        LogFormat("dmis", "DMIS output", dmis.recognise, dmis.read),
        LogFormat("tof", "frames of a multi-zone ranging sensor", tof.recognise, tof.read),
        LogFormat("fanuc", "a FANUC program (.LS)", fanuc.recognise, fanuc.read),
        LogFormat("kuka", "a KUKA data list or program (.dat, .src)", krl.recognise, krl.read),
        LogFormat("abb", "ABB robtargets (RAPID)", rapid.recognise, rapid.read),
        LogFormat("ur", "poses of URScript", urscript.recognise, urscript.read),
        LogFormat("bcnc", "a bCNC probe file", bcnc.recognise, bcnc.read),
        LogFormat("linuxcnc", "a LinuxCNC probe log (PROBEOPEN)", cncprobe.recognise, cncprobe.read),
        LogFormat("xyzijk", "points with vectors (X Y Z I J K)", points.recognise_vectors, points.read_vectors),
        LogFormat("asc", "a list of points (X Y Z ...)", points.recognise_points, points.read_points),
    )
}
"""All formats by name, in the order in which they are asked."""


def register_format(entry: LogFormat) -> LogFormat:
    """Add a format; it is asked before those that are there already.

    Raises:
        InputError: The name is taken.
    """
    if entry.name in FORMATS or entry.name == TABLE:
        raise InputError(f"format: expected a name of its own, got '{entry.name}', which is taken. Choose another.")
    known = dict(FORMATS)
    FORMATS.clear()
    FORMATS.update({entry.name: entry, **known})
    return entry


def recognise(contents: Contents) -> LogFormat | None:
    """The first format whose content this is; None for none of them."""
    return next((row for row in FORMATS.values() if row.recognise(contents)), None)


def format_named(name: str) -> LogFormat | None:
    """The format of this name; None for the project's own table.

    Raises:
        InputError: Nobody knows it; the message lists all.
    """
    known = (TABLE, *FORMATS)
    if name not in known:
        raise InputError(f"format: expected one of {', '.join(known)}, got '{name}'.{did_you_mean(name, known)}")
    return FORMATS.get(name)
