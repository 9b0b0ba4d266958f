"""Register the formats of logs, each with its functions to recognize and read it; plug-ins are tried first."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from tanteo.errors import InputError, PluginError, TanteoError, did_you_mean
from tanteo.io.logs import (
    axis_rows,
    axis_words,
    bcnc,
    cloud,
    cncprobe,
    console,
    dmis,
    fanuc,
    krl,
    pcdmis,
    ply,
    point_lists,
    points,
    probe_lines,
    qif,
    rangefinder,
    rapid,
    reprap,
    results,
    tof,
    urscript,
)
from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import note_on_end
from tanteo.io.logs.log import Log, LogFormat
from tanteo.plugins import Registry, guarded, warn

TABLE, RECORDING = "csv", "bag"
"""Names of tanteo's table with a header and of ROS recordings, which ``tanteo.io`` reads."""

FORMATS: Registry[LogFormat] = Registry(
    "tanteo.log_formats",
    LogFormat,
    {
        row.name: row
        for row in (
            LogFormat("ply", "a PLY point cloud", ply.recognise, ply.read),
            LogFormat("pcd", "a PCD point cloud", cloud.recognise, cloud.read),
            LogFormat("qif", "a QIF document", qif.recognise, qif.read),
            LogFormat("grbl", "a GRBL console log", console.recognise, console.read),
            *(
                LogFormat(name, words, partial(probe_lines.recognises, name), partial(probe_lines.read, name))
                for name, words in (
                    ("tinyg", "probe reports of TinyG or g2core"),
                    ("klipper", "a Klipper console log"),
                    ("marlin", "a Marlin console log"),
                )
            ),
            LogFormat("reprap", "a height map of RepRapFirmware", reprap.recognise, reprap.read),
            LogFormat("pcdmis", "a listing of PC-DMIS", pcdmis.recognise, pcdmis.read),
            LogFormat("report", "a report with one row for each axis", axis_rows.recognise, axis_rows.read),
            LogFormat("fusion", "a probe results file (G800, G801)", results.recognise, results.read, results.ENDS),
            LogFormat("dmis", "DMIS output", dmis.recognise, dmis.read, dmis.ENDS),
            LogFormat("tof", "frames of a multi-zone ranging sensor", tof.recognise, tof.read),
            LogFormat("rangefinder", "ranges of a single beam", rangefinder.recognise, rangefinder.read),
            LogFormat("fanuc", "a FANUC program (.LS)", fanuc.recognise, fanuc.read, fanuc.ENDS),
            LogFormat("kuka", "a KUKA data list or program (.dat, .src)", krl.recognise, krl.read, krl.ENDS),
            LogFormat("abb", "ABB robtargets (RAPID)", rapid.recognise, rapid.read, rapid.ENDS),
            LogFormat("ur", "poses of URScript", urscript.recognise, urscript.read, urscript.ENDS),
            LogFormat("json", "a JSON list of points", point_lists.recognise_json, point_lists.read_json),
            LogFormat("xml", "an XML list of points", point_lists.recognise_xml, point_lists.read_xml),
            LogFormat("bcnc", "a bCNC probe file", bcnc.recognise, bcnc.read),
            LogFormat("linuxcnc", "a LinuxCNC probe log (PROBEOPEN)", cncprobe.recognise, cncprobe.read),
            LogFormat("xyzijk", "points with vectors (X Y Z I J K)", points.recognise_vectors, points.read_vectors),
            LogFormat("words", "positions as words (X .. Y .. Z ..)", axis_words.recognise, axis_words.read),
            LogFormat("asc", "a list of points (X Y Z ...)", points.recognise_points, points.read_points),
        )
    },
    reserved=(TABLE, RECORDING),
)
"""All formats by name, in the order in which they are tried; plug-ins come first."""


def register_format(entry: LogFormat) -> LogFormat:
    """Add a format in this process; it is tried before the existing ones.

    Args:
        entry: format to add.

    Raises:
        InputError: the name is taken.
    """
    FORMATS.register(entry.name, entry)
    return entry


def recognise(contents: Contents) -> LogFormat | None:
    """Return the first format that recognizes the contents; None if none does.

    A plug-in that fails is skipped with a warning.

    Args:
        contents: file to test.

    Raises:
        TanteoError: a format of tanteo itself fails.
    """
    for form in FORMATS.entries():
        origin = FORMATS.origin(form.name)
        try:
            with guarded(origin, "contents to be recognised"):
                if form.recognise(contents):
                    return form
        except TanteoError as error:
            if not origin:
                raise
            warn(str(error))
    return None


def read_log(form: LogFormat, contents: Contents) -> Log:
    """Read contents in a given format.

    Args:
        form: format of the contents.
        contents: file to read.

    Raises:
        ReadingsError: the contents are malformed, or end within a number.
        PluginError: a plug-in fails, or does not return a :class:`Log`.
    """
    origin = FORMATS.origin(form.name)
    with guarded(origin, f"{contents.name} to be read"):
        log = form.read(contents)
        cut = note_on_end(contents, form.ends)
    if origin and not isinstance(log, Log):
        raise PluginError(f"{origin}: expected a Log of {contents.name}, got {type(log).__name__}. Repair it.")
    return replace(log, notes=(*log.notes, cut)) if cut else log


def format_named(name: str) -> LogFormat | None:
    """Return the format with a given name; None for tanteo's own table.

    Args:
        name: name of the format.

    Raises:
        InputError: there is no such format; the message lists all.
        PluginError: the plug-in of that name cannot be used.
    """
    found = FORMATS.find(name)
    if found is None and name != TABLE:
        known = (TABLE, *FORMATS.names())
        raise InputError(f"format: expected one of {', '.join(known)}, got '{name}'.{did_you_mean(name, known)}")
    return found
