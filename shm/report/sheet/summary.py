"""The paragraph on top of a test's sheet: what was measured, what came of it, can it be trusted."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from shm.report import words
from shm.report.sheet.content import TestSheet
from shm.report.verdicts import overall
from shm.values import PLANES, Mode, Plane, QualityCheck, Verdict

HEADLINES: dict[Verdict, str] = {
    "good": "Good",
    "warning": "Use with care",
    "refused": "Do not use",
    "unknown": "Not checked",
}
_MOST_REMEDIES = 3


def name(sheet: TestSheet) -> str:
    """`Test t7, Hanger 3`, as far as it is known."""
    test = sheet.identification.test
    if sheet.hanger is not None:
        return f"Test {test.id}, {words.hanger_name(sheet.hanger.id, sheet.hanger.name)}"
    return f"Test {test.id}" if test.hanger is None else f"Test {test.id}, Hanger {test.hanger}"


def summary(sheet: TestSheet) -> str:
    """One paragraph in plain words."""
    sentences = (measured(sheet), _modes(sheet), _set_aside(sheet), trust(sheet), advice(sheet))
    return " ".join(sentence for sentence in sentences if sentence)


def measured(sheet: TestSheet) -> str:
    test = sheet.identification.test
    when = f"{words.moment(test.time)}, {words.temperature(test.temperature_c)}"
    return f"This test ({when}) has {_sensors(sheet)}{_excitation(sheet)}."


def _sensors(sheet: TestSheet) -> str:
    response = sheet.identification.frequency_response
    points: Sequence[tuple[str | None, float]] = []
    if response is not None:
        points = [(point.plane, point.x_m) for point in response.points]
    elif sheet.recordings:
        points = [(c.plane, c.x_m) for c in sheet.recordings[0].accelerations]
    if not points:
        return "no records at hand"
    places = {x_m for _, x_m in points if math.isfinite(x_m)}
    at = f" at {words.counted(len(places), 'place')}" if places else ""
    planes = {plane for plane, _ in points if plane}
    where = {0: "", 1: f" in the {next(iter(planes), '')} plane", 2: " in both planes"}
    return f"{words.counted(len(points), 'acceleration channel')}{at}{where[len(planes)]}"


def _excitation(sheet: TestSheet) -> str:
    if len(sheet.used_hits) == len(sheet.hits) == 1:
        return " and one hit"
    if not sheet.hits:
        given = sheet.identification.frequency_response is not None
        return ", given as frequency responses" if given else " of ambient motion: nobody hit"
    reasons = Counter(hit.reason for hit in sheet.hits if not hit.used)
    left = words.listed([f"{count} {reason}" for reason, count in reasons.items()] or [""])
    dropped = f", {sum(reasons.values())} dropped ({left})" if reasons else ""
    hits = words.counted(len(sheet.hits), "hit")
    return f" and {hits}: {len(sheet.used_hits) if reasons else 'all'} used{dropped}"


def _modes(sheet: TestSheet) -> str:
    if not sheet.modes:
        return "No mode was identified."
    groups = [_group(sheet, plane) for plane in PLANES]
    listed = words.listed([group for group in groups if group])
    verb = "was" if len(sheet.modes) == 1 else "were"
    return f"{words.counted(len(sheet.modes), 'mode')} {verb} identified: {listed}."


def _group(sheet: TestSheet, plane: Plane) -> str:
    modes = sorted((m for m in sheet.modes if m.plane == plane), key=lambda m: m.frequency_hz)
    if not modes:
        return ""
    low, high = modes[0].frequency_hz, modes[-1].frequency_hz
    span = f"{low:.4g} Hz" if len(modes) == 1 else f"{low:.4g} to {high:.4g} Hz"
    return f"{plane} {_orders(modes)} ({span})"


def _orders(modes: Sequence[Mode]) -> str:
    """`1 to 3, 5, 7 to 9`."""
    runs: list[list[int]] = []
    for order in sorted(mode.order for mode in modes):
        if runs and order == runs[-1][-1] + 1:
            runs[-1].append(order)
        else:
            runs.append([order])
    return ", ".join(str(r[0]) if len(r) == 1 else f"{r[0]} to {r[-1]}" for r in runs)


def _set_aside(sheet: TestSheet) -> str:
    found = sheet.identification.set_aside
    if not found:
        return ""
    listed = words.listed([f"{each.kind} at {each.frequency_hz:.4g} Hz" for each in found])
    return f"Set aside as no modes of the hanger: {listed}."


def trust(sheet: TestSheet) -> str:
    """Whether the modes can be used."""
    checks = sheet.identification.quality
    made = [check for check in checks if check.verdict != "unknown"]
    match overall(checks):
        case "refused":
            return f"Do not use it: refused by {_names(checks, 'refused')}."
        case "warning":
            count = len([check for check in made if check.verdict == "warning"])
            verb = "warns" if count == 1 else "warn"
            of = words.counted(len(made), "check")
            named = _names(checks, "warning")
            return f"The modes can be used with care: {count} of {of} {verb} ({named})."
        case "good":
            which = f"all {len(made)} checks" if len(made) > 1 else "the one check"
            verb = "are" if len(made) > 1 else "is"
            return f"The modes can be trusted: {which} that could be made {verb} good."
        case "unknown":
            return "Its quality was not checked: judge by the figures before using the modes."


def _names(checks: Sequence[QualityCheck], verdict: Verdict) -> str:
    return words.listed([check.name for check in checks if check.verdict == verdict])


def advice(sheet: TestSheet) -> str:
    """What to do next, gravest first."""
    checks = sheet.identification.quality
    graves = sorted(
        (c for c in checks if c.verdict in ("refused", "warning") and c.remedy),
        key=lambda check: check.verdict != "refused",
    )
    if graves:
        more = len(graves) - _MOST_REMEDIES
        rest = f" See the quality for {more} more." if more > 0 else ""
        return f"Next: {' '.join(c.remedy for c in graves[:_MOST_REMEDIES])}{rest}"
    return "Nothing needs doing before using them." if overall(checks) == "good" else ""
