"""Reports on A4 paper, as PDF: the same nouns that the pages show, set by reportlab."""

from __future__ import annotations

from shm.report.bridge.content import BridgeReport
from shm.report.content import HangerReport
from shm.report.sheet.content import TestSheet


# What sets a paper is imported where one is asked for: the daemon and most verbs need none.
def pdf(data: HangerReport) -> bytes:
    """The report of one hanger: the same bytes for the same content."""
    from shm.report.paper.hanger import hanger_paper
    from shm.report.paper.pdf import made

    return made(hanger_paper(data))


def bridge_pdf(data: BridgeReport) -> bytes:
    """The report of a bridge."""
    from shm.report.paper.bridge import bridge_paper
    from shm.report.paper.pdf import made

    return made(bridge_paper(data))


def test_pdf(sheet: TestSheet) -> bytes:
    """The sheet of one test."""
    from shm.report.paper.pdf import made
    from shm.report.paper.sheet import test_paper

    return made(test_paper(sheet))
