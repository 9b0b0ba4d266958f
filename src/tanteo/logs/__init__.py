"""Logs of others: what probes, machines, robots, scanners and ranging sensors write, as plain arrays.

Each format is one file and one entry of :data:`FORMATS`: its name, how its content is recognised, how it is read. What
comes out is a :class:`Log`, in the file's own units and in its own words; ``tanteo.io.read_readings`` makes readings of
it, once what the file lacks is known. Nothing here opens a file but :class:`TableText`, when it is asked to.
"""

from tanteo.logs.contents import Contents
from tanteo.logs.formats import FORMATS, RECORDING, format_named, read_log, recognise, register_format
from tanteo.logs.log import Log, LogFormat
from tanteo.logs.table_text import HEAD_BYTES, Lines, TableText, sniff

__all__ = [
    "FORMATS", "HEAD_BYTES", "RECORDING", "Contents", "Lines", "Log", "LogFormat", "TableText", "format_named",
    "read_log", "recognise", "register_format", "sniff",
]  # fmt: skip
