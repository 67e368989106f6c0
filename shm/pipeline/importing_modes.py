"""Modes that another program identified, as a document of modal tests.

Their axes become planes by what a person says once for that program's files. Orders are the numbers
of half waves where the shapes show them, else they count from 1 in each plane by frequency. No
uncertainty is made up: where the file says none, it stays unknown.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from shm.documents import dump
from shm.errors import BadInput
from shm.modes_document import modes_document
from shm.pipeline.importing import Answers, Question
from shm.read.base import Layout
from shm.read.modal_sets import ForeignModalMode, ForeignModes, axes_of
from shm.read.profiles import Profile, completed, profile_for, save_profile
from shm.store import Workspace
from shm.values import ModalTest, Mode, Plane, as_test_id

_LEAST_PLACES = 3  # judgement: fewer places show no order beyond the second


@dataclass(frozen=True, eq=False)
class ImportedModes:
    """Modes of another program as they will be taken in; `test` is None while one is asked for."""

    found: ForeignModes
    test: ModalTest | None
    hanger: int | None
    planes: Mapping[str, Plane]
    orders: tuple[int, ...]
    questions: tuple[Question, ...]
    notes: tuple[str, ...]
    layout: Layout
    is_known: bool

    @property
    def document(self) -> str:
        """The text of a *.modes.json, which says of which program and file the modes are."""
        assert self.test is not None
        source = {"file": Path(self.found.source).name, "program": self.found.program}
        whole = json.loads(dump(modes_document([self.test])))
        return json.dumps({**whole, "source": source}, ensure_ascii=False, indent=1)


def understand_modes(found: ForeignModes, workspace: Workspace, answers: Answers) -> ImportedModes:
    """The modes of a file with all that is known of them; raises BadInput for an unknown hanger."""
    axes = axes_of(found.modes)
    if not axes:
        raise BadInput(
            "no mode has a shape, so that nothing says its plane.",
            file=found.source,
            remedy="Export the shapes too, or write the modes into a NAME.modes.json.",
        )
    layout = _layout(found, axes)
    profile = profile_for(layout, workspace.folder)
    known = profile.described if profile else {}
    described = completed(known, layout, answers.stated, Path(found.source).name)
    planes: dict[str, Plane] = {
        axis: table["plane"]
        for axis, table in described.get("channel", {}).items()
        if "plane" in table
    }
    hanger = described.get("hanger")
    questions = _questions(axes, planes, hanger)
    if hanger is not None:
        workspace.bridge.tested(hanger)
    orders, notes = _orders(found.modes)
    test = None
    if not questions:
        test = ModalTest(
            as_test_id(Path(found.source).stem),
            tuple(_mode(m, planes, n) for m, n in zip(found.modes, orders, strict=True) if m.axis),
            hanger,
            answers.time,
            answers.temperature_c,
        )
    return ImportedModes(
        found, test, hanger, planes, orders, questions, notes, layout, profile is not None
    )


def keep_modes_profile(
    found: ImportedModes, workspace: Workspace, answers: Answers
) -> Profile | None:
    """Keeps hanger and planes for the next file of this program."""
    profiled = {k: v for k, v in answers.stated.items() if k in ("hanger", "channel")}
    if not profiled:
        return profile_for(found.layout, workspace.folder)
    before = profile_for(found.layout, workspace.folder)
    whole = completed(before.described if before else {}, found.layout, profiled)
    return save_profile(whole, found.layout, workspace.folder, roams=answers.each_time)


def _layout(found: ForeignModes, axes: Sequence[str]) -> Layout:
    program = "".join(c for c in found.program if not c.isdigit())
    digest = hashlib.sha256("\n".join(("UFF 55", program, *axes)).encode()).hexdigest()
    return Layout(digest[:16], "UFF 55", tuple(axes))


def _questions(
    axes: Sequence[str], planes: Mapping[str, Plane], hanger: int | None
) -> tuple[Question, ...]:
    asked = []
    if hanger is None:
        asked.append(Question("hanger", "", "Which hanger was tested?", "--hanger N"))
    for axis in axes:
        if axis not in planes:
            text = f"Which plane is axis {axis} of the shapes (transverse or longitudinal)?"
            option = f"--plane {axis}=transverse|longitudinal"
            asked.append(Question("plane", axis, text, option))
    return tuple(asked)


def _orders(modes: Sequence[ForeignModalMode]) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """The order of each mode in its plane, and what a person should know about it."""
    notes: list[str] = []
    orders = dict.fromkeys(range(len(modes)), 0)
    for axis in axes_of(modes):
        places = [i for i, mode in enumerate(modes) if mode.axis == axis]
        waves = [modes[i].half_waves for i in places]
        shown = all(len(modes[i].points) >= max(_LEAST_PLACES, modes[i].half_waves) for i in places)
        rising = all(a < b for a, b in pairwise(waves)) and all(waves)
        for rank, (place, half_waves) in enumerate(zip(places, waves, strict=True), start=1):
            orders[place] = half_waves if shown and rising else rank
        if not (shown and rising):
            notes.append(
                f"the shapes along {axis} do not show the orders: numbered from 1 by frequency;"
                " `shm select` says where one more or less fits better."
            )
    without = sum(not mode.axis for mode in modes)
    if without:
        notes.append(f"{without} modes have no shape, so that their plane is unknown; left out.")
    if not any(mode.points for mode in modes):
        notes.append("the file does not say where its nodes are: no shape is kept.")
    notes.append("the file says no uncertainty of the frequencies: it stays unknown.")
    return tuple(orders.values()), tuple(notes)


def _mode(mode: ForeignModalMode, planes: Mapping[str, Plane], order: int) -> Mode:
    return Mode(
        plane=planes[mode.axis],
        order=order,
        frequency_hz=mode.frequency_hz,
        damping_ratio=mode.damping_ratio,
        shape=mode.points,
    )
