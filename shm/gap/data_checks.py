"""What is wrong with the tests of a diagnosis, in words, and what that does to the answer.

A tension alone can follow fewer than four frequencies, whatever the ends are. The baseline's ends
hold it far too closely; what `shm update` finds with ends of any stiffness, averaged over its
classes of beam, does not, and stands for the baseline where there is no gap.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from statistics import median

from shm.errors import BadInput
from shm.gap.observations import told_of_rounding
from shm.inference import UpdateOptions, select
from shm.models import applicable, build
from shm.values import FEW_MODES, PLANES, FloatArray, Hanger, ModalTest, Mode
from shm.values.modes import MOST_SLOPE

# Judgement: 4.5 are rare and no proof (`shm.gap.outliers`); among some hundred pairs six never are.
_CONTRADICTION_SD = 6.0
# Judgement: no thermometer on a bar, and no hand with a hammer, is more alike from test to test.
SURE_COMMON_SDS = 3.0  # judgement: by chance one test in 370
_SAME_TEMPERATURE_K, _SAME_LEVEL = 2.0, 1.1
_OF_A_MODE = ("plane", "order", "frequency_hz", "frequency_sd_hz", "damping_ratio", "shape")
_OF_A_TEST = ("temperature_c", "amplitude", "added_mass", "tension_read_n")
_UNITS = {2 * math.pi: "rad/s", 60.0: "rpm", 1e-3: "kHz"}
_SAME_UNIT = 1.8
"""Factor. Judgement: a tension of a third to three times the nominal one; ends do less. What is as
near to another unit calls for a tension beyond the prior."""


@dataclass(frozen=True)
class Usable:
    """The tests that a diagnosis uses, and what was found on the way to them.

    `other_unit` is the one of `remarks` that the frequencies look given in another unit, if any.
    """

    tests: tuple[ModalTest, ...]
    remarks: tuple[str, ...]
    other_unit: tuple[str, ...] = ()


def usable(tests: Sequence[ModalTest], hanger: Hanger) -> Usable:
    """Tests without the modes that cannot be what they are called, with a remark for each fault.

    Raises BadInput where nothing is left, where two tests have one name, belong to another hanger
    or have masses or sensors beyond its ends.
    """
    _refuse(tests, hanger)
    unit = _other_unit(tests, hanger)
    tests, copied = _without_copies(tests)
    kept, remarks = [], [each for each in (unit, copied) if each]
    for test in tests:
        doubtful = _doubtful(test)
        remarks += [f"Test {test.id}: {reason}" for reason in doubtful.values()]
        modes = tuple(mode for mode in test.modes if _name(mode) not in doubtful)
        if modes:
            kept.append(replace(test, modes=modes))
    if not kept:
        raise BadInput(
            "no test holds a mode that can be used. " + " ".join(remarks),
            remedy="Give tests with modes whose orders rise with their frequencies.",
        )
    remarks = [*remarks, *_said_of_all(kept, hanger)]
    return Usable(tuple(kept), tuple(remarks), (unit,) if unit else ())


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


def _other_unit(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """What the frequencies look like where they are not in Hz, by a bar half pinned, half clamped
    at the nominal tension."""
    pairs = []
    for mode in (mode for test in tests for mode in test.modes if mode.frequency_hz > 0):
        wave = math.pi * (mode.order + 0.25) / hanger.length_m
        pull_n = hanger.nominal_tension_n + hanger.bending_stiffness_n_m2 * wave**2
        expected_hz = wave / (2 * math.pi) * math.sqrt(pull_n / hanger.mass_per_length_kg_m)
        pairs.append((math.log(mode.frequency_hz), math.log(expected_hz)))
    if not pairs:
        return ""
    away = {
        unit: median(abs(f - e - math.log(by)) for f, e in pairs) for by, unit in _UNITS.items()
    }
    away["s (periods)"] = median(abs(f + e) for f, e in pairs)
    unit = min(away, key=lambda each: away[each])
    ratio = math.exp(median(f - e for f, e in pairs))
    if away[unit] > math.log(_SAME_UNIT) or abs(math.log(ratio)) < 2 * math.log(_SAME_UNIT):
        return ""
    return (
        f"The frequencies look given in {unit}, not in Hz: they are {ratio:.2g} times those of the "
        "description at its nominal tension. Give them in Hz and diagnose again."
    )


def _without_copies(tests: Sequence[ModalTest]) -> tuple[list[ModalTest], str]:
    """The tests, of those that hold the same numbers the first only, with a remark."""
    kept: dict[str, ModalTest] = {}
    copies: list[str] = []
    for test in tests:
        # As text, for unknown numbers are no equal numbers.
        numbers = repr([*map(_numbers, test.modes), *_numbers(test)])
        if numbers in kept:
            copies.append(f"{test.id} (as {kept[numbers].id})")
        kept.setdefault(numbers, test)
    if not copies:
        return list(tests), ""
    return list(kept.values()), (
        f"The same numbers to the last digit as another test: {', '.join(copies)}. Copies say "
        "nothing new; each is counted once."
    )


def _numbers(of: ModalTest | Mode) -> list[object]:
    names = _OF_A_MODE if isinstance(of, Mode) else _OF_A_TEST
    return [getattr(of, name) for name in names]


def _places(test: ModalTest) -> Iterator[tuple[str, float]]:
    if test.added_mass is not None:
        yield "the added mass", test.added_mass.x_m
    for mode in test.modes:
        for point in mode.shape:
            yield f"a sensor of {_name(mode)}", point.x_m


def _name(mode: Mode) -> str:
    return f"{mode.plane} {mode.order}"


def _doubtful(test: ModalTest) -> dict[str, str]:
    """The modes of a test whose order cannot be right, and why."""
    found: dict[str, str] = {}
    for plane in PLANES:
        modes = sorted((m for m in test.modes if m.plane == plane), key=lambda m: m.order)
        for one, other in pairwise(modes):
            if one.order == other.order:
                found[_name(one)] = (
                    f"{_name(one)} is given twice ({one.frequency_hz:g} and "
                    f"{other.frequency_hz:g} Hz); it is left out."
                )
            elif one.frequency_hz >= other.frequency_hz:
                reason = (
                    f"{_name(other)} ({other.frequency_hz:g} Hz) does not lie above {_name(one)} "
                    f"({one.frequency_hz:g} Hz); both are left out, since a wrong order would look "
                    f"like a large gap."
                )
                found[_name(one)] = found[_name(other)] = reason
    return found


def _said_of_all(tests: Sequence[ModalTest], hanger: Hanger) -> list[str]:
    remarks = [
        told_of_few(tests, hanger),
        _irregular(tests),
        _without_sd(tests),
        told_of_rounding(tests),
        _without_temperature(tests),
        _without_shape_sd(tests),
        _amplitude(tests),
        _rattling(tests),
        _unused_readings(tests),
    ]
    return [remark for remark in remarks if remark] + _contradictions(tests)


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
    """The baseline's tension is then another one than that inferred elsewhere."""
    found = [
        f"{_name(mode)} of test {test.id} ({mode.frequency_hz:g} Hz)"
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
    missing = sum(math.isnan(point.sd) for point in points)
    if not missing:
        return ""
    return (
        f"{missing} of {len(points)} points of mode shapes have no standard deviation: their "
        f"shapes are not used, and what only shapes show stays hidden."
    )


def common_slope(tests: Sequence[ModalTest]) -> tuple[float, float]:
    """The weighted mean of all modes' `amplitude_slope`, and its standard deviation; inf of none.

    What slips lowers all frequencies, a guide or stretching raises all: together they tell more
    surely than each.
    """
    known = [m for t in tests for m in t.modes if abs(m.amplitude_slope) < MOST_SLOPE]
    weight = sum(m.amplitude_slope_sd**-2 for m in known if m.amplitude_slope_sd > 0)
    if not weight:
        return 0.0, math.inf
    each = (m.amplitude_slope / m.amplitude_slope_sd**2 for m in known if m.amplitude_slope_sd > 0)
    return sum(each) / weight, weight**-0.5


def _amplitude(tests: Sequence[ModalTest]) -> str:
    changing = [m for test in tests for m in test.modes if m.depends_on_amplitude]
    if not changing:
        slope, sd = common_slope(tests)
        if abs(slope) <= SURE_COMMON_SDS * sd:
            return ""
        return (
            f"Something depends on amplitude: all frequencies together are {100 * abs(slope):.2g} "
            f"% {'lower' if slope < 0 else 'higher'} at that of a hit than at small amplitude "
            f"({abs(slope) / sd:.0f} standard deviations), though none is surely so by itself."
        )
    most = max((mode.amplitude_slope for mode in changing), key=abs)
    side = "lower" if most < 0 else "higher"
    which = f"{len(changing)} frequencies depend" if len(changing) > 1 else "One frequency depends"
    return (
        f"{which} on amplitude, at that of a hit up to {100 * abs(most):.2g} % {side}: those of "
        "small amplitude are compared, and the change counts as a test at another amplitude."
    )


def _rattling(tests: Sequence[ModalTest]) -> str:
    told = [test for test in tests if math.isfinite(test.rattles_above)]
    if not told:
        return ""
    return (
        f"Above a level of {min(test.rattles_above for test in told):.2g} the hanger does not ring "
        f"as a bar does ({_listed([test.id for test in told])}): something knocks, such as a guide "
        f"with play, slips or opens. {_whose(told)}"
    )


def _whose(tests: Sequence[ModalTest]) -> str:
    if all(test.amplitude <= test.rattles_above for test in tests):
        return "The frequencies are those of smaller swings."
    return "The frequencies are means over ring-downs: test again with softer hits."


def _contradictions(tests: Sequence[ModalTest]) -> list[str]:
    """Pairs of tests under like conditions whose frequencies differ beyond their errors."""
    found = []
    for one, other in combinations(tests, 2):
        worst = _worst_difference(one, other) if _alike(one, other) else None
        if worst is not None and worst[1] > _CONTRADICTION_SD:
            mode, ratio_sd, percent = worst
            found.append(
                f"Tests {one.id} and {other.id} contradict each other: made under the same "
                f"conditions, {mode} differs by {percent:.2f} % ({ratio_sd:.0f} standard "
                f"deviations). No steady effect can explain both, so that something unexplained "
                f"becomes likely; if the hanger changed in between, diagnose them one by one."
            )
    return found


def _alike(one: ModalTest, other: ModalTest) -> bool:
    """Return True if the tests were made under the same conditions, as far as these are known.

    A temperature must be known of both; what else is unknown of both counts as the same.
    """
    if one.added_mass != other.added_mass:
        return False
    if not abs(one.temperature_c - other.temperature_c) <= _SAME_TEMPERATURE_K:
        return False
    pairs = [(one.tension_read_n, other.tension_read_n), (one.amplitude, other.amplitude)]
    if any(math.isnan(first) != math.isnan(second) for first, second in pairs):
        return False
    if abs(one.tension_read_n - other.tension_read_n) > 0:
        return False
    levels = one.amplitude, other.amplitude
    return not max(levels) > _SAME_LEVEL * min(levels)


def _worst_difference(one: ModalTest, other: ModalTest) -> tuple[str, float, float] | None:
    """The mode that differs most, in standard deviations and in percent; None without these."""
    theirs = {_name(mode): mode for mode in other.modes}
    differences = []
    for mode in one.modes:
        match = theirs.get(_name(mode))
        if match is None:
            continue
        sd = math.hypot(mode.frequency_sd_hz, match.frequency_sd_hz)
        apart = abs(mode.frequency_hz - match.frequency_hz)
        if sd > 0:
            differences.append((_name(mode), apart / sd, 100 * apart / mode.frequency_hz))
    return max(differences, key=lambda found: found[1], default=None)


def _listed(names: Sequence[str]) -> str:
    return f"test {names[0]}" if len(names) == 1 else f"tests {', '.join(names)}"


_BEAMS = ("beam1", "beam2", "beam3")


def told_of_few(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """What so few modes can show; empty where there are more."""
    names = _modes(tests)
    if len(names) >= FEW_MODES:
        return ""
    only = "Only one mode is" if len(names) == 1 else f"Only {len(names)} modes are"
    return (
        f"{only} given ({', '.join(sorted(names))}): {_what_they_do(tests, hanger)}; give at least "
        f"{FEW_MODES}, better eight a plane."
    )


def tension_of_any_ends_n(
    tests: Sequence[ModalTest], hanger: Hanger, seed: int
) -> FloatArray | None:
    """Draws of the tension (draws,) where it alone can follow what few modes were measured, with
    ends of any stiffness; None where there are more or something else holds it.
    """
    if len(_modes(tests)) >= FEW_MODES or _held_by(tests, hanger):
        return None
    names, _ = applicable(hanger, _BEAMS)
    return select(
        tests, [build(name, hanger) for name in names], UpdateOptions(seed=seed)
    ).tension_n


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
    """Why the tension cannot follow the frequencies, so that a gap shows though not its cause."""
    alike = "but most causes look alike in so few frequencies"
    if hanger.nominal_tension_n == 0:
        return f"the bar carries no tension that could follow them, so that a gap can show, {alike}"
    if math.isfinite(hanger.scatter.tension):
        known = f"the tension is known to {100 * hanger.scatter.tension:.2g} %"
        return f"{known}, so that a gap can show, {alike}"
    read_n = {test.tension_read_n for test in tests if math.isfinite(test.tension_read_n)}
    if len(read_n) > 1:
        return (
            "a gap shows only where the frequencies do not change as the tensions that were read "
            "do, and most causes look alike in that"
        )
    return ""
