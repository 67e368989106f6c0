"""A deck that no model describes, with weekly tests, and what it loses."""

from __future__ import annotations

import math
from datetime import timedelta

import numpy as np

from shm.documents import dump
from shm.modes_document import modes_document
from shm.store import Workspace
from shm.values import ModalTest, Mode
from tests.helpers.workspaces import START

DECK = 100
HZ = (("transverse", 1, 2.0), ("longitudinal", 1, 3.1), ("transverse", 2, 4.7))
WEEK, LOST_FROM = 7, 11


def with_a_deck(workspace: Workspace) -> Workspace:
    """The workspace with a deck in its description."""
    config = workspace.folder / "bridge.toml"
    config.write_text(f'{config.read_text()}\n[[structure]]\nid = {DECK}\nname = "Deck"\n')
    return Workspace.open(workspace.folder)


def write_week(workspace: Workspace, week: int) -> None:
    """A test into the spool; from `LOST_FROM` on all frequencies are 4 % lower."""
    draw, loss = np.random.default_rng(week), -0.04 * (week >= LOST_FROM)
    modes = tuple(
        Mode(plane, order, hz * math.exp(loss + 3e-4 * draw.normal()), 3e-4 * hz)  # type: ignore[arg-type]
        for plane, order, hz in HZ
    )
    time = START + timedelta(days=WEEK * week - 50)
    test = ModalTest(f"w{week}", modes, DECK, time, 12.0)
    (workspace.spool / f"w{week}.modes.json").write_text(dump(modes_document([test])))
