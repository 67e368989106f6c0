"""A workbook as Excel saves it (ECMA-376), part by part: no clock is in its bytes."""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from tests.worlds.logger_tables import Held, held, spelt
from tests.worlds.recordings import Recording

_NS = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
_REL = 'xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"'
_TYPE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_XML = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'


def _letters(column: int) -> str:
    return chr(65 + column) if column < 26 else chr(64 + column // 26) + chr(65 + column % 26)


def _relations(*targets: tuple[str, str]) -> str:
    rows = "".join(
        f'<Relationship Id="rId{i}" Type="{_TYPE}/{kind}" Target="{target}"/>'
        for i, (kind, target) in enumerate(targets, 1)
    )
    space = "http://schemas.openxmlformats.org/package/2006/relationships"
    return f'<Relationships xmlns="{space}">{rows}</Relationships>'


def _cells(record: Recording, units: Sequence[str]) -> str:
    """Four rows of remarks, names in row 5 with units below; numbers, blanks for gaps."""
    texts = {
        1: ["Messung Hänger 3"],
        2: ["Datum", f"{record.start:%d.%m.%Y}"],
        3: ["Abtastrate", f"{record.rate_hz:g} Hz"],
        5: ["Zeit", *record.names],
        6: ["s", *units],
    }
    lines = []
    for number, cells in texts.items():
        inner = "".join(
            f'<c r="{_letters(i)}{number}" t="inlineStr"><is><t>{escape(t)}</t></is></c>'
            for i, t in enumerate(cells)
        )
        lines.append(f'<row r="{number}">{inner}</row>')
    letters = [_letters(i) for i in range(1 + record.data.shape[1])]
    table = np.column_stack([record.time_s, record.data]).tolist()
    for number, row in enumerate(table, 7):
        inner = "".join(
            f'<c r="{x}{number}" s="1"><v>{v!r}</v></c>'
            for x, v in zip(letters, row, strict=True)
            if v == v
        )
        lines.append(f'<row r="{number}">{inner}</row>')
    return "".join(lines)


_DRAWING = "http://schemas.openxmlformats.org/drawingml/2006"
_CHART = (
    f'<c:chartSpace xmlns:c="{_DRAWING}/chart"><c:chart>'
    '<c:plotArea><c:layout/><c:lineChart><c:grouping val="standard"/><c:ser><c:idx val="0"/>'
    '<c:order val="0"/><c:val><c:numRef><c:f>Daten!$B$7:$B$99</c:f></c:numRef></c:val></c:ser>'
    '<c:axId val="1"/><c:axId val="2"/></c:lineChart><c:catAx><c:axId val="1"/><c:scaling/>'
    '<c:axPos val="b"/><c:crossAx val="2"/></c:catAx><c:valAx><c:axId val="2"/><c:scaling/>'
    '<c:axPos val="l"/><c:crossAx val="1"/></c:valAx></c:plotArea></c:chart></c:chartSpace>'
)
_ANCHOR = (
    f'<xdr:wsDr xmlns:xdr="{_DRAWING}/spreadsheetDrawing" xmlns:a="{_DRAWING}/main">'
    '<xdr:absoluteAnchor><xdr:pos x="0" y="0"/><xdr:ext cx="9000000" cy="6000000"/>'
    '<xdr:graphicFrame macro=""><xdr:nvGraphicFramePr><xdr:cNvPr id="2" name="Diagramm 1"/>'
    '<xdr:cNvGraphicFramePr/></xdr:nvGraphicFramePr><xdr:xfrm><a:off x="0" y="0"/>'
    '<a:ext cx="0" cy="0"/></xdr:xfrm><a:graphic>'
    f'<a:graphicData uri="{_DRAWING}/chart"><c:chart xmlns:c="{_DRAWING}/chart" {_REL} '
    'r:id="rId1"/></a:graphicData></a:graphic></xdr:graphicFrame><xdr:clientData/>'
    "</xdr:absoluteAnchor></xdr:wsDr>"
)
_STYLES = (
    f'<styleSheet {_NS}><numFmts count="1"><numFmt numFmtId="164" '
    'formatCode="[$-407]#,##0.000000"/></numFmts><fonts count="1"><font/></fonts>'
    '<fills count="1"><fill><patternFill patternType="none"/></fill></fills>'
    '<borders count="1"><border/></borders>'
    '<cellStyleXfs count="1"><xf/></cellStyleXfs><cellXfs count="2"><xf/>'
    '<xf numFmtId="164" applyNumberFormat="1"/></cellXfs><cellStyles count="1">'
    '<cellStyle name="Standard" xfId="0" builtinId="0"/></cellStyles></styleSheet>'
)
_WORKBOOK = (
    f'<workbook {_NS} {_REL}><sheets><sheet name="Diagramm1" sheetId="2" r:id="rId1"/>'
    '<sheet name="Daten" sheetId="1" r:id="rId2"/></sheets></workbook>'
)
_CHARTSHEET = (
    f'<chartsheet {_NS} {_REL}><sheetViews><sheetView workbookViewId="0"/></sheetViews>'
    '<drawing r:id="rId1"/></chartsheet>'
)
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_KIND = "application/vnd.openxmlformats-officedocument"


def _content_types() -> str:
    overrides = "".join(
        f'<Override PartName="/xl/{part}.xml" ContentType="{_KIND}.{kind}+xml"/>'
        for part, kind in (
            ("workbook", "spreadsheetml.sheet.main"),
            ("chartsheets/sheet1", "spreadsheetml.chartsheet"),
            ("worksheets/sheet1", "spreadsheetml.worksheet"),
            ("styles", "spreadsheetml.styles"),
            ("drawings/drawing1", "drawing"),
            ("charts/chart1", "drawingml.chart"),
        )
    )
    return (
        f'<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f'<Default Extension="xml" ContentType="application/xml"/>{overrides}</Types>'
    )


def xlsx(path: Path, record: Recording) -> Held:
    """Excel, German: a chart sheet first, numbers shown with a comma, names in row 5, then units.

    The comma is only how cells are shown: they hold numbers.  The date is text.
    """
    units = [spelt(c) for c in record.channels]
    parts = {
        "[Content_Types].xml": _content_types(),
        "_rels/.rels": _relations(("officeDocument", "xl/workbook.xml")),
        "xl/workbook.xml": _WORKBOOK,
        "xl/_rels/workbook.xml.rels": _relations(
            ("chartsheet", "chartsheets/sheet1.xml"),
            ("worksheet", "worksheets/sheet1.xml"),
            ("styles", "styles.xml"),
        ),
        "xl/chartsheets/sheet1.xml": _CHARTSHEET,
        "xl/chartsheets/_rels/sheet1.xml.rels": _relations(("drawing", "../drawings/drawing1.xml")),
        "xl/drawings/drawing1.xml": _ANCHOR,
        "xl/drawings/_rels/drawing1.xml.rels": _relations(("chart", "../charts/chart1.xml")),
        "xl/charts/chart1.xml": _CHART,
        "xl/styles.xml": _STYLES,
        "xl/worksheets/sheet1.xml": f"<worksheet {_NS}><sheetData>{_cells(record, units)}"
        "</sheetData></worksheet>",
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, text in parts.items():
            entry = zipfile.ZipInfo(name, (2024, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, (_XML + text).encode("utf-8"))
    return held(record, units=units, rate_hz=record.rate_hz)
