"""Parse logs of other programs (probes, machines, robots, scanners, ranging sensors) into plain arrays.

Each format is one module and one entry of :data:`FORMATS`: its name, a function that recognizes it, and one that reads
it. The result is a :class:`Log` in the file's own units. ``tanteo.io.read_readings`` converts it to readings, once the
user has stated what the file lacks. Only :class:`TableText` opens files.
"""

from tanteo.logs.contents import Contents
from tanteo.logs.formats import FORMATS, RECORDING, format_named, read_log, recognise, register_format
from tanteo.logs.log import Log, LogFormat
from tanteo.logs.table_text import HEAD_BYTES, Lines, TableText, sniff

__all__ = [
    "FORMATS", "HEAD_BYTES", "RECORDING", "Contents", "Lines", "Log", "LogFormat", "TableText", "format_named",
    "read_log", "recognise", "register_format", "sniff",
]  # fmt: skip
