"""Name files that hold no readings, or not in a form that can be read, and state what to export instead.

The marks are those of the formats' own first lines: ISO 10303-21 (STEP), IGES, DXF, VDA-FS (DIN 66301), PDF, HTML;
``BEGIN PGM`` of Heidenhain, and the logs of its touch probe cycles 420 to 431 (TNC 320, Touch probe cycles);
``CYCLE9xx`` and ``_OVR[]`` of Siemens (SINUMERIK, Measuring cycles); ``Bilinear Leveling Grid`` of Marlin
(``G29.cpp``); ``[bed_mesh`` of Klipper's ``printer.cfg``.
"""

from __future__ import annotations

import re

from tanteo.io.logs.contents import Contents

_LINE = re.MULTILINE | re.IGNORECASE
_NAMED = (
    (r"\A\s*ISO-10303-21\s*;", "a CAD file (STEP)", "Give it with --part; the readings are another file"),
    (r"\A.{72}S *1 *$|\A\s*0\s*\n\s*SECTION\s*$|\A\s*\w+ *= *HEADER */", "a CAD file (IGES, DXF or VDA)",
     "Give a STEP file with --part; export its points as a table x_mm,y_mm,z_mm"),
    (r"\A%PDF-", "a PDF report", "Export the measured points as text or CSV"),
    (r"\A\s*<(?:!doctype html|html|table)\b", "a web page", "Export the measured points as text or CSV"),
    (r"^\s*\d*\s*BEGIN PGM\b", "a Heidenhain program", "Give the file that FN 16: F-PRINT writes, with X, Y and Z"),
    (r"^[^\n;]*\bCYCLE9\d\d\b", "a Siemens program or log of measuring cycles",
     "Write the measured points with WRITE as lines X=.. Y=.. Z=.., or as a table"),
    (r"^[*\s]*(?:Measuring log (?:for )?(?:probing|touch)|Messprotokoll Antastzyklus)",
     "a log of Heidenhain's measuring cycles (TCHPR)",
     "Write its actual values as a table x_mm,y_mm,hole_diameter_mm, or X, Y and Z of touches with FN 16"),
    (r"^\s*#\d{1,4}\s*=", "variables of a macro",
     "Write X, Y and Z of each touch with DPRNT[X#5061[44]Y#5062[44]Z#5063[44]]"),
    (r"\A\s*planid\b[^\n]*\tidsymbol\b", "characteristics of Calypso without positions",
     "Add xValue, yValue and zValue of each feature to the plan, or export the measured points as text"),
    (r"^[^\n]*\b_OV[RI]\[\d", "result variables of Siemens' measuring cycles",
     "Write the measured points with WRITE as lines X=.. Y=.. Z=.., or as a table"),
    (r"^(?:N\d+\s*)?G0?[0-3]\b[^\n]*[XYZ]|^\s*[O:]\d{4}\b|^(?:N\d+\s*)?G(?:90|91|20|21|54|65)\b",
     "a G-code program", "Give the log of the probed positions: DPRNT, a console log or PROBEOPEN write one"),
    (r"\b(?:Bilinear Leveling Grid|Bed Topography Report|Mesh Bed Level data)\b", "heights of a bed without places",
     "Record the console during G29 V4, which prints 'Bed X: .. Y: .. Z: ..' for each point"),
    (r"^(?:ok )?X:\s*-?\d[^\n]*\bCount\b", "position reports (M114), which are no contacts",
     "Record what the probe reports: lines 'Bed X: .. Y: .. Z: ..' of G30 or G29 V4"),
    (r"^(?:#\*#\s*)?\[bed_mesh\b", "a configuration of Klipper",
     "Record the console during BED_MESH_CALIBRATE, which prints 'probe .. at X,Y .. z=Z' for each point"),
    (r"^(?:// )?Stopped at height\b", "heights of RepRapFirmware without places", "Give heightmap.csv of G29"),
)  # fmt: skip


def refuse_by_name(contents: Contents) -> None:
    """Refuse a file that is recognized as something else than readings.

    Args:
        contents: start of the file.

    Raises:
        ReadingsError: it is one of the known others; the message names it and what to export.
    """
    start = contents.head or contents.data[:100].decode("latin-1")
    for pattern, words, advice in _NAMED:
        if re.search(pattern, start, _LINE):
            contents.fail("readings", words, f"{advice} (docs/formats_logs.md).")
