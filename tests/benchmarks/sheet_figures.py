"""How long the figures and the page of a large test take, and how large the page is.

Sixteen channels, five hits, 60 s at 2048 Hz, twenty-four modes. Exits 1 where a bound fails.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

from shm.report.as_html import as_html
from shm.report.contents import ModalTestReport
from shm.report.modal_test_report import modal_test_figures as report_test_figures
from shm.report.modal_test_report import modal_test_paper
from tests.report.sheets import make_points, make_recording, make_sheet, warned

PLACES_M = (0.9, 2.1, 3.4, 4.6, 5.8, 7.1, 8.3, 9.6)
RATE_HZ = 2048.0
SLOT_S = 12.0
MOST_SECONDS = 5.0
MOST_BYTES = 2_000_000


def large_sheet() -> ModalTestReport:
    sheet = warned(make_sheet(places_m=PLACES_M, orders=12))
    record = make_recording(sheet.modes, make_points(PLACES_M), 5, SLOT_S, RATE_HZ)
    starts_s = [number * SLOT_S + 0.5 for number in range(5)]
    hits = tuple(
        replace(hit, start=round(start_s * RATE_HZ), start_s=start_s)
        for hit, start_s in zip(sheet.hits, starts_s, strict=True)
    )
    return replace(
        sheet, identification=replace(sheet.identification, hits=hits), records=(record,)
    )


def main() -> int:
    argparse.ArgumentParser(description=__doc__).parse_args()
    sheet = large_sheet()
    begin = time.process_time()
    figures = [item.svg() for item in report_test_figures(sheet)]
    drawn = time.process_time()
    page = as_html(modal_test_paper(sheet))
    done = time.process_time()
    size = len(page.encode())
    print(f"{'figures, SVG':20} {drawn - begin:8.2f} s   {sum(map(len, figures)) / 1e6:6.2f} MB")
    print(f"{'page':20} {done - drawn:8.2f} s   {size / 1e6:6.2f} MB")
    return int(drawn - begin > MOST_SECONDS or size > MOST_BYTES)


if __name__ == "__main__":
    sys.exit(main())
