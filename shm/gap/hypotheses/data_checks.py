"""Remarks on what keeps the tests of a diagnosis from showing more.

The data themselves are checked by `shm.inference.problem.data_checks`, as for every tension.

A tension alone can follow fewer than four frequencies, whatever the ends are. The baseline's ends
hold it far too closely; what `shm update` finds with ends of any stiffness, averaged over its
classes of beam, does not, and stands for the baseline where there is no gap.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from shm.errors import BadInput
from shm.gap.hypotheses.observations import remark_on_rounding
from shm.inference.problem.data_checks import CheckedData, check_data, mode_name
from shm.values import FEW_MODES, Hanger, ModalTest


def usable(tests: Sequence[ModalTest], hanger: Hanger) -> CheckedData:
    """Return the tests that a diagnosis uses, with a remark for each fault.

    Raises BadInput where nothing is left, where two tests have one name, belong to another hanger
    or have masses or sensors beyond its ends.
    """
    _refuse(tests, hanger)
    checked = check_data(tests, hanger)
    used = tuple(test for test in checked.tests if test.modes)
    if not used:
        raise BadInput("no test holds a mode that can be used.", remedy="Give tests with modes.")
    return replace(checked, tests=used, remarks=(*checked.remarks, *_remark_on_all(used, hanger)))


def _refuse(tests: Sequence[ModalTest], hanger: Hanger) -> None:
    for name, times in Counter(test.id for test in tests).items():
        if times > 1:
            raise BadInput(f"test id {name} is given {times} times.", remedy="Give each its own.")
    for test in tests:
        if test.hanger is not None and test.hanger != hanger.id:
            raise BadInput(
                f"test {test.id} is of hanger {test.hanger}, not of {hanger.id}.",
                remedy="Diagnose the hangers one by one.",
            )
        for what, x_m in _places(test):
            if not 0 <= x_m <= hanger.length_m:
                raise BadInput(
                    f"test {test.id}: {what} at {x_m:g} m is beyond the ends of the hanger "
                    f"(0 to {hanger.length_m:g} m).",
                    remedy="Measure x_m from the deck end, in m.",
                )


def _places(test: ModalTest) -> Iterator[tuple[str, float]]:
    if test.added_mass is not None:
        yield "the added mass", test.added_mass.x_m
    for mode in test.modes:
        for point in mode.shape:
            yield f"a sensor of {mode_name(mode)}", point.x_m


def _remark_on_all(tests: Sequence[ModalTest], hanger: Hanger) -> list[str]:
    remarks = [
        remark_on_few_modes(tests, hanger),
        _irregular(tests),
        _without_sd(tests),
        remark_on_rounding(tests),
        _without_temperature(tests),
        _without_shape_sd(tests),
        _without_own_plane(tests),
        _amplitude(tests),
        _rattling(tests),
        _unused_readings(tests),
    ]
    return [remark for remark in remarks if remark]


def _unused_readings(tests: Sequence[ModalTest]) -> str:
    """Return a remark where a tension was read, but no two readings differ; empty for others."""
    read_n = {test.tension_read_n for test in tests if math.isfinite(test.tension_read_n)}
    if len(read_n) != 1:
        return ""
    return (
        f"The tension read, {read_n.pop() / 1e3:.4g} kN, is not used: only differences between "
        "readings of several tests are. To use its level give it as nominal_tension_n, with "
        "`tension` in [hanger.scatter]."
    )


def _irregular(tests: Sequence[ModalTest]) -> str:
    """Return a remark on modes that `shm update` leaves out, which has another tension then."""
    found = [
        f"{mode_name(mode)} of test {test.id} ({mode.frequency_hz:g} Hz)"
        for test in tests
        for mode in test.modes
        if mode.irregular
    ]
    if not found:
        return ""
    are, them = ("is", "it") if len(found) == 1 else ("are", "them")
    return (
        f"Well off the beam that the other modes follow {are} {', '.join(found)}: the diagnosis "
        f"takes {them}, `shm update` leaves {them} out, so that the tension by the baseline alone "
        f"differs from that of `shm update`."
    )


def _without_sd(tests: Sequence[ModalTest]) -> str:
    modes = [mode for test in tests for mode in test.modes]
    missing = sum(not mode.frequency_sd_hz > 0 for mode in modes)
    zero = " (0 is none)" if any(mode.frequency_sd_hz == 0 for mode in modes) else ""
    if not missing:
        return ""
    which = (
        "No frequency has"
        if missing == len(modes)
        else f"{missing} of {len(modes)} frequencies have no"
    )
    what = "a standard deviation" if missing == len(modes) else "standard deviation"
    return (
        f"{which} {what}{zero}: how exact they are is estimated together with the cause, from 0.01 "
        f"to 3 %. A gap can then pass for scatter, and the fit cannot be judged by itself; "
        f"identify the recordings, which gives each frequency its standard deviation."
    )


def _without_temperature(tests: Sequence[ModalTest]) -> str:
    missing = [test.id for test in tests if math.isnan(test.temperature_c)]
    if not missing or len(missing) == len(tests):
        return ""
    return (
        f"No temperature is known of {_listed(missing)}: taken as the mean of the others, which "
        f"hides or imitates an effect of the temperature."
    )


def _without_shape_sd(tests: Sequence[ModalTest]) -> str:
    points = [point for test in tests for mode in test.modes for point in mode.shape]
    missing = sum(not point.sd > 0 for point in points)
    if not missing:
        return ""
    return (
        f"{missing} of {len(points)} points of mode shapes have no standard deviation (0 is none): "
        f"they are not used, and what only shapes show stays hidden."
    )


def _without_own_plane(tests: Sequence[ModalTest]) -> str:
    shapes = [mode.shape for test in tests for mode in test.modes if mode.shape]
    missing = sum(not any(math.isfinite(p.value) and p.value for p in shape) for shape in shapes)
    if not missing:
        return ""
    return (
        f"{missing} of {len(shapes)} mode shapes have no value in their mode's own plane: they are "
        "not used."
    )


def _amplitude(tests: Sequence[ModalTest]) -> str:
    changing = [m for test in tests for m in test.modes if m.depends_on_amplitude]
    if not changing:
        return ""
    most = max((mode.amplitude_slope for mode in changing), key=abs)
    side = "lower" if most < 0 else "higher"
    which = f"{len(changing)} frequencies depend" if len(changing) > 1 else "One frequency depends"
    return (
        f"{which} on amplitude, at that of a hit up to {100 * abs(most):.2g} % {side}: those of "
        "small amplitude are compared, and the change counts as a test at another amplitude."
    )


def _rattling(tests: Sequence[ModalTest]) -> str:
    rattling = [test for test in tests if math.isfinite(test.rattles_above)]
    if not rattling:
        return ""
    return (
        f"Above a level of {min(test.rattles_above for test in rattling):.2g} the hanger does not "
        f"ring as a bar does ({_listed([test.id for test in rattling])}): something knocks, such "
        f"as a guide with play, slips or opens. {_whose(rattling)}"
    )


def _whose(tests: Sequence[ModalTest]) -> str:
    if all(test.amplitude <= test.rattles_above for test in tests):
        return "The frequencies are those of smaller swings."
    return "The frequencies are means over ring-downs: test again with softer hits."


def _listed(names: Sequence[str]) -> str:
    return f"test {names[0]}" if len(names) == 1 else f"tests {', '.join(names)}"


def remark_on_few_modes(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """Return what so few modes can show; empty where there are more."""
    names = _modes(tests)
    if len(names) >= FEW_MODES:
        return ""
    only = "Only one mode is" if len(names) == 1 else f"Only {len(names)} modes are"
    return (
        f"{only} given ({', '.join(sorted(names))}): {_what_they_do(tests, hanger)}; give at least "
        f"{FEW_MODES}, better eight a plane."
    )


def _modes(tests: Sequence[ModalTest]) -> set[str]:
    return {f"{mode.plane} {mode.order}" for test in tests for mode in test.modes}


def _what_they_do(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    held = _held_by(tests, hanger)
    if held:
        return held
    return (
        "tension alone can follow so few frequencies, so that a gap can hardly show and its cause "
        "cannot; without one the tension is that of `shm update`, with ends of any stiffness"
    )


def _held_by(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """Return why the tension cannot follow the frequencies: a gap shows, though not its cause."""
    why = "but most causes look alike in so few frequencies"
    if hanger.nominal_tension_n == 0:
        return f"the bar carries no tension that could follow them, so that a gap can show, {why}"
    if math.isfinite(hanger.scatter.tension):
        known = f"the tension is known to {100 * hanger.scatter.tension:.2g} %"
        return f"{known}, so that a gap can show, {why}"
    read_n = {test.tension_read_n for test in tests if math.isfinite(test.tension_read_n)}
    if len(read_n) > 1:
        return (
            "a gap shows only where the frequencies do not change as the tensions that were read "
            "do, and most causes look alike in that"
        )
    return ""
