"""Checks on the data of modal tests, the same for every inference and diagnosis.

A test counts as what it can show: copies and readings of one spectral line count once, modes whose
order cannot be right and gross errors are left out. Each such decision is a remark.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise
from statistics import median
from typing import Any

from shm.errors import BadInput
from shm.inference.problem.priors import reading_sd_n
from shm.models import THESIS, Model
from shm.values import COUNTED_ONCE, LEFT_OUT, NAN, OTHER_UNIT, PLANES, Hanger, ModalTest, Mode
from shm.values.modes import MOST_SLOPE
from shm.values.rounding import two_digits

_OF_A_MODE = ("plane", "order", "frequency_hz", "frequency_sd_hz", "damping_ratio", "shape")
_OF_A_TEST = ("temperature_c", "amplitude", "added_mass", "tension_read_n")
_UNITS = {2 * math.pi: "rad/s", 60.0: "rpm", 1e-3: "kHz"}
SAME_LEVEL = 1.1
"""Ratio of amplitudes that count as the same. Judgement: no hand hits more evenly."""
_SAME_UNIT = 1.8
"""Factor. Judgement: a tension of a third to three times the nominal one; ends do less. What is as
near to another unit calls for a tension beyond the prior."""

# Six digits are more than anybody rounds to; a number of full precision is a multiple, to so much
# of it, by chance of one in 500.
_FINEST_HZ, _TO = 1e-6, 1e-3
_COARSEST_HZ = 1.0  # judgement: what is coarser was not rounded; a step is a part of this
_FEWEST_TO_ROUND = 3  # distinct ones: chance makes the step of three twice as coarse in 1 of 8


@dataclass(frozen=True)
class CheckLimits:
    """Hold the limits of the checks, all of them judgement.

    `gross_sd` standard deviations are a contradiction: 4.5 are rare and no proof
    (`shm.gap.causes.outliers`), six are never met among some hundred pairs. Only a test or mode
    that differs by more than `least_gross`, as a fraction, is left out, and at most `most_left_out`
    of the tests (one may always be). In the hardest test a guide with play may raise a mode by up
    to `largest_by_amplitude`, which is no error. The spectral lines of a record are f_s / 2^k
    apart; sampling rates in use are a power of two times one of `rate_factors`. A peak fewer than
    `fewest_lines` lines above 0 Hz is hidden by drift, so nobody reads one there. Frequencies match
    a line by chance with less than `chance_of_line`. A tension that was read is in another unit
    where it is `reading_off` times what a taut string would carry, or one part in so many of it:
    units of force are 1000 apart, and the string of a bar with tension is right to a few times.
    """

    gross_sd: float = 6.0
    least_gross: float = 0.01
    largest_by_amplitude: float = 0.3
    most_left_out: float = 0.25
    fewest_for_majority: int = 3
    rate_factors: tuple[int, ...] = (1, 25, 75, 125, 375, 625, 11025)
    fewest_lines: int = 8
    finest_line_hz: float = 1e-3
    most_decimals: int = 9
    chance_of_line: float = 1e-4
    reading_off: float = 30.0


_LIMITS = CheckLimits()


@dataclass(frozen=True)
class CheckedData:
    """Hold the tests as they count, and a remark for each thing that was changed or is doubtful.

    `other_unit` is the remark that the frequencies look given in another unit, if there is one.
    """

    tests: tuple[ModalTest, ...]
    remarks: tuple[str, ...] = ()
    other_unit: tuple[str, ...] = field(default=())


def check_data(tests: Sequence[ModalTest], hanger: Hanger) -> CheckedData:
    """Return the tests as they count, with remarks; raises BadInput where the checks leave none.

    Tests that hold no mode from the start, only a tension that was read, stay.
    """
    unit = _compare_units(tests, hanger)
    used, remarks = list(tests), [unit] if unit else _doubt_stated_errors(tests, hanger)
    # What a string would carry is not known of frequencies in another unit.
    checks = () if unit else (_leave_out_readings,)
    for check in (*checks, _count_lines_once, _count_copies_once, _leave_out_wrong_orders):
        used, added = check(used, hanger)
        remarks += added
    used, added = _leave_out_gross_errors(used, hanger)
    remarks += [*added, *_name_contradictions(used, hanger)]
    if not any(test.modes for test in used) and any(test.modes for test in tests):
        raise BadInput(
            "no test holds a mode that can be used. " + " ".join(remarks),
            remedy="Give tests with modes whose orders rise with their frequencies.",
        )
    return CheckedData(tuple(used), tuple(remarks), (unit,) if unit else ())


def check_for_update(
    tests: Sequence[ModalTest], model: Model
) -> tuple[Sequence[ModalTest], dict[str, Any]]:
    """Return the tests that a posterior of `model` uses, and the posterior's fields on them.

    The priors of the thesis count data as given: it gives ten copies of a test on purpose.
    """
    if model.priors == THESIS:
        return tests, {}
    checked = check_data(tests, model.hanger)
    regular = (mode for test in checked.tests for mode in test.regular_modes)
    modes = [mode for mode in regular if mode.frequency_hz > 0 and mode.order > 0]
    string_n = taut_string_tension_n(
        [mode.frequency_hz for mode in modes], [mode.order for mode in modes], model.hanger
    )
    stated = [mode.frequency_sd_hz / mode.frequency_hz for mode in modes if not is_bare(mode)]
    zero = sum(mode.frequency_sd_hz == 0 for mode in modes)
    doubt = f"A standard deviation of 0 counts as not stated ({zero} of {len(modes)} frequencies)."
    return checked.tests, {
        "remarks": (*checked.remarks, *([doubt] if zero else [])),
        "taut_string_tension_n": string_n,
        "stated_error_percent": 100 * math.hypot(*stated) / math.sqrt(len(stated) or NAN),
    }


def taut_string_tension_n(
    frequency_hz: Sequence[float], order: Sequence[int], hanger: Hanger
) -> float:
    """Return the tension of a string without bending stiffness with these modes; NaN without any.

    It is mu (2 L f/n)^2, with the median of f/n.
    """
    if not len(order):
        return NAN
    per_order = median(float(hz) / int(n) for hz, n in zip(frequency_hz, order, strict=True))
    return float(hanger.mass_per_length_kg_m * (2 * hanger.length_m * per_order) ** 2)


def mode_name(mode: Mode) -> str:
    """Return the plane and order of a mode, such as `transverse 1`."""
    return f"{mode.plane} {mode.order}"


# ---------------------------------------------------------------- units and orders


def _compare_units(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """Return a remark where frequencies look given in another unit than Hz, else an empty text."""
    pairs = [
        (math.log(mode.frequency_hz), math.log(_expected_hz(mode.order, hanger)))
        for test in tests
        for mode in test.modes
        if mode.frequency_hz > 0 and mode.order > 0
    ]
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
        f"{OTHER_UNIT} {unit}, not in Hz: they are {two_digits(ratio)} times those of the "
        "description at its nominal tension. Give them in Hz, or check nominal_tension_n."
    )


def _expected_hz(order: int, hanger: Hanger, tension_n: float = NAN) -> float:
    """Return a frequency of a bar half pinned, half clamped, at the nominal or a given tension."""
    tension_n = tension_n if math.isfinite(tension_n) else hanger.nominal_tension_n
    wave = math.pi * (order + 0.25) / hanger.length_m
    pull_n = tension_n + hanger.bending_stiffness_n_m2 * wave**2
    return wave / (2 * math.pi) * math.sqrt(max(pull_n, 0.0) / hanger.mass_per_length_kg_m)


def _doubt_stated_errors(tests: Sequence[ModalTest], hanger: Hanger) -> list[str]:
    """Name the largest stated error of a frequency, where it is larger than any reading's.

    That is the most of what is assumed where none is stated: of peaks read off a plot by eye.
    """
    stated = [
        (mode.frequency_sd_hz / mode.frequency_hz, test, mode)
        for test in tests
        for mode in test.regular_modes
        if mode.frequency_hz > 0 and not is_bare(mode)
    ]
    large = [each for each in stated if each[0] > hanger.assumptions.unstated_frequency_sd.upper]
    if not large:
        return []
    _, test, mode = max(large, key=lambda each: each[0])
    more = f" {len(large) - 1} more frequencies have such errors." if len(large) > 1 else ""
    return [
        f"Test {test.id} states a standard deviation of {mode.frequency_sd_hz:g} Hz of "
        f"{mode_name(mode)}, {mode.frequency_hz:g} Hz: check its unit (frequency_sd_hz is in Hz). "
        f"So large an error hides what does not fit.{more}"
    ]


def _leave_out_readings(
    tests: Sequence[ModalTest], hanger: Hanger, limits: CheckLimits = _LIMITS
) -> tuple[list[ModalTest], list[str]]:
    """Leave out tensions read in another unit than N, by what frequencies say."""
    regular = (mode for test in tests for mode in test.regular_modes)
    modes = [mode for mode in regular if mode.frequency_hz > 0 and mode.order > 0]
    string_n = taut_string_tension_n(
        [mode.frequency_hz for mode in modes], [mode.order for mode in modes], hanger
    )
    # A slack bar sounds by its stiffness alone, and carries far less than a string would.
    tells_tension = any(
        mode.frequency_hz > _SAME_UNIT * _expected_hz(mode.order, hanger, 0.0) for mode in modes
    )
    least_n = string_n / limits.reading_off if tells_tension else -math.inf
    used, remarks = [], []
    for test in tests:
        read_n = test.tension_read_n
        if read_n < least_n or read_n > limits.reading_off * string_n:
            remarks.append(
                f"{LEFT_OUT}: the tension read in test {test.id}, {read_n:g} N, is "
                f"{two_digits(read_n / string_n)} of what a taut string with these frequencies "
                "carries: give it in N."
            )
            if not test.modes:
                continue
            test = replace(test, tension_read_n=NAN, tension_read_sd_n=NAN)
        used.append(test)
    return used, remarks


def _leave_out_wrong_orders(
    tests: Sequence[ModalTest], _: Hanger
) -> tuple[list[ModalTest], list[str]]:
    """Leave out modes whose order cannot be right."""
    used, remarks = [], []
    for test in tests:
        wrong = _find_wrong_orders(test)
        remarks += [
            f"{LEFT_OUT}: test {test.id}, {reason}" for reason in dict.fromkeys(wrong.values())
        ]
        used += _without(test, wrong)
    return used, remarks


def _find_wrong_orders(test: ModalTest) -> dict[str, str]:
    """Return the modes of a test whose order cannot be right, each with the reason."""
    found: dict[str, str] = {}
    for plane in PLANES:
        modes = sorted((m for m in test.modes if m.plane == plane), key=lambda m: m.order)
        for one, other in pairwise(modes):
            if one.order == other.order:
                found[mode_name(one)] = (
                    f"{mode_name(one)}, which is given twice ({one.frequency_hz:g} and "
                    f"{other.frequency_hz:g} Hz)."
                )
            elif one.frequency_hz >= other.frequency_hz:
                reason = (
                    f"{mode_name(other)} ({other.frequency_hz:g} Hz) does not lie above "
                    f"{mode_name(one)} ({one.frequency_hz:g} Hz). Neither is used, since a wrong "
                    "order would look like a large gap."
                )
                found[mode_name(one)] = found[mode_name(other)] = reason
    return found


def _without(test: ModalTest, names: Collection[str]) -> list[ModalTest]:
    """Return a test without the modes of these names, none where these were all it held."""
    modes = tuple(mode for mode in test.modes if mode_name(mode) not in names)
    if len(modes) == len(test.modes):
        return [test]
    return [replace(test, modes=modes)] if modes else []


# ---------------------------------------------------------------- what counts once


def _count_copies_once(tests: Sequence[ModalTest], _: Hanger) -> tuple[list[ModalTest], list[str]]:
    """Use the first of those tests that hold the same numbers."""
    first: dict[str, ModalTest] = {}
    copies: list[str] = []
    for test in tests:
        # As text, for unknown numbers are no equal numbers.
        numbers = repr([*map(_numbers, test.modes), *_numbers(test)])
        if numbers in first:
            copies.append(f"{test.id} (as {first[numbers].id})")
        first.setdefault(numbers, test)
    if not copies:
        return list(tests), []
    return list(first.values()), [
        f"{COUNTED_ONCE}: the same numbers to the last digit as another test: {', '.join(copies)}. "
        "A copy adds no information."
    ]


def _numbers(of: ModalTest | Mode) -> list[object]:
    names = _OF_A_MODE if isinstance(of, Mode) else _OF_A_TEST
    return [getattr(of, name) for name in names]


def _count_lines_once(
    tests: Sequence[ModalTest], hanger: Hanger
) -> tuple[list[ModalTest], list[str]]:
    """Use a frequency once that several tests, all without stated error, repeat to the last digit.

    It is one reading of a spectral line, whose width gives its standard deviation where it can be
    inferred.
    """
    groups: dict[str, list[tuple[int, Mode]]] = defaultdict(list)
    for index, test in enumerate(tests):
        for mode in test.modes:
            key = repr((mode.plane, mode.order, test.added_mass, test.tension_read_n))
            groups[key].append((index, mode))
    repeated = [
        group
        for group in groups.values()
        if len({index for index, _ in group}) > 1
        if len({mode.frequency_hz for _, mode in group}) == 1
        if all(is_bare(mode) for _, mode in group)
    ]
    if not repeated:
        return list(tests), []
    involved = sorted({index for group in repeated for index, _ in group})
    line_hz = find_line_hz([m.frequency_hz for i in involved for m in tests[i].modes if is_bare(m)])
    sd_hz = line_hz / math.sqrt(12)
    least = hanger.assumptions.unstated_frequency_sd.value
    first = {(group[0][0], mode_name(group[0][1])) for group in repeated}
    later = {(index, mode_name(mode)) for group in repeated for index, mode in group} - first
    used: list[ModalTest] = []
    for index, test in enumerate(tests):
        modes = [
            replace(mode, frequency_sd_hz=max(sd_hz, least * mode.frequency_hz))
            if line_hz and (index, mode_name(mode)) in first
            else mode
            for mode in test.modes
            if (index, mode_name(mode)) not in later
        ]
        if modes or not test.modes:
            used.append(replace(test, modes=tuple(modes)))
    return used, [_describe_line([group[0][1] for group in repeated], tests, involved, line_hz)]


def _describe_line(
    modes: Sequence[Mode], tests: Sequence[ModalTest], involved: Sequence[int], line_hz: float
) -> str:
    lowest = min(modes, key=lambda mode: mode.frequency_hz)
    one = len(modes) == 1
    which = f"{mode_name(lowest)} is" if one else f"{len(modes)} frequencies are"
    start = (
        f"{COUNTED_ONCE}: {which} the same to the last digit in {len(involved)} tests "
        f"({tests[involved[0]].id} to {tests[involved[-1]].id}), one reading of a spectral line."
    )
    if not line_hz:
        return f"{start} Its error is not known: identify the recordings."
    sd_hz = line_hz / math.sqrt(12)
    return (
        f"{start} Lines {line_hz:.4g} Hz apart give a standard deviation of {sd_hz:.2g} Hz, "
        f"{100 * sd_hz / lowest.frequency_hz:.2g} % of {mode_name(lowest)}. Identify the "
        "recordings, or read longer ones."
    )


def find_line_hz(frequencies_hz: Sequence[float], limits: CheckLimits = _LIMITS) -> float:
    """Return the distance of the spectral lines, or of the rounding, of these; 0 where unknown."""
    distinct = sorted(set(frequencies_hz))
    if not all(0 < each < math.inf for each in distinct):
        return 0.0
    to_hz = [0.5 * 10.0 ** -_decimals(each, limits) for each in distinct]
    lines = (
        line_hz
        for line_hz in _possible_lines_hz(distinct[0] / limits.fewest_lines, limits)
        if math.prod(min(1.0, 2 * to / line_hz) for to in to_hz) < limits.chance_of_line
        if all(
            abs(each - round(each / line_hz) * line_hz) <= to
            for each, to in zip(distinct, to_hz, strict=True)
        )
    )
    return next(lines, 0.0) or _rounding_hz(distinct)


def _possible_lines_hz(widest_hz: float, limits: CheckLimits) -> list[float]:
    """Return the distances that the lines of a record may have, the widest first."""
    found = []
    for factor in limits.rate_factors:
        line_hz = factor * 2.0 ** math.floor(math.log2(widest_hz / factor))
        while line_hz >= limits.finest_line_hz:
            found.append(line_hz)
            line_hz /= 2
    return sorted(found, reverse=True)


def _decimals(value: float, limits: CheckLimits) -> int:
    """Return how many decimals a number was written with."""
    decimals = range(limits.most_decimals)
    return next((k for k in decimals if round(value, k) == value), limits.most_decimals)


def step_hz(test: ModalTest) -> float:
    """Return what all frequencies of a test without a standard deviation are multiples of; or 0."""
    return _rounding_hz([mode.frequency_hz for mode in test.modes if is_bare(mode)])


def _rounding_hz(frequencies_hz: Sequence[float]) -> float:
    """Return what frequencies were rounded to; 0 where this cannot be inferred."""
    finest = {each / _FINEST_HZ for each in frequencies_hz}
    if len(finest) < _FEWEST_TO_ROUND or any(abs(each - round(each)) > _TO for each in finest):
        return 0.0
    return _FINEST_HZ * math.gcd(*map(round, finest), round(_COARSEST_HZ / _FINEST_HZ))


def is_bare(mode: Mode) -> bool:
    """Return True for a mode whose frequency has no standard deviation."""
    return not mode.frequency_sd_hz > 0


# ---------------------------------------------------------------- gross errors


@dataclass(frozen=True)
class _Entry:
    """Hold one mode of one test; `deviation` is that of its ln f from what is expected of it."""

    test: ModalTest
    mode: Mode
    deviation: float


def _leave_out_gross_errors(
    tests: Sequence[ModalTest], hanger: Hanger, limits: CheckLimits = _LIMITS
) -> tuple[list[ModalTest], list[str]]:
    """Leave out what differs by far from all other tests, where these agree.

    A test with more wrong modes than right ones is left out completely.
    """
    gross: dict[str, list[tuple[_Entry, float, float, int]]] = defaultdict(list)
    for group in _comparable(tests, hanger):
        if len(group) < limits.fewest_for_majority:
            continue
        for entry, deviation, agree in _find_gross(group, hanger, limits):
            gross[entry.test.id].append((entry, deviation, agree, len(group)))
    used, remarks = [], []
    for test in tests:
        wrong = gross.get(test.id, [])
        if not wrong:
            used.append(test)
            continue
        out = {mode_name(entry.mode) for entry, *_ in wrong}
        is_test = 2 * len(wrong) > len(test.modes)
        remarks.append(_describe_gross(test, wrong, is_test))
        if not is_test:
            used += _without(test, out)
    return used, remarks


def _find_gross(
    group: Sequence[_Entry], hanger: Hanger, limits: CheckLimits
) -> list[tuple[_Entry, float, float]]:
    """Return the entries far from the median, by how much, and how well the others agree.

    None where they are too many to be errors: then the tests contradict each other.
    """
    middle = min(group, key=lambda each: abs(each.deviation - median(e.deviation for e in group)))
    deviations = {id(each): abs(each.deviation - middle.deviation) for each in group}
    spread = 1.4826 * median(deviations.values())
    found = [
        each
        for each in group
        if deviations[id(each)] > _least_gross(each, group, limits)
        if deviations[id(each)]
        > limits.gross_sd * max(spread, _difference_sd(each, middle, hanger))
    ]
    if len(found) > max(1, int(limits.most_left_out * len(group))):
        return []
    agree = max(deviations[id(each)] for each in group if each not in found)
    return [(each, each.deviation - middle.deviation, agree) for each in found]


def _least_gross(entry: _Entry, group: Sequence[_Entry], limits: CheckLimits) -> float:
    """Return the deviation above which an entry may be a gross error."""
    others = max(each.test.amplitude for each in group if each is not entry)
    is_hardest = entry.test.amplitude > SAME_LEVEL * others
    return limits.largest_by_amplitude if is_hardest else limits.least_gross


def _describe_gross(
    test: ModalTest, wrong: Sequence[tuple[_Entry, float, float, int]], is_test: bool
) -> str:
    entry, deviation, agree, count = max(wrong, key=lambda each: abs(each[1]))
    side = "lower" if deviation < 0 else "higher"
    name = mode_name(entry.mode)
    what = f"test {test.id}. Its {name}" if is_test else f"{name} of test {test.id}. It"
    more = f" (and {len(wrong) - 1} more of its modes)" if len(wrong) > 1 else ""
    read = math.isfinite(test.tension_read_n)
    return (
        f"{LEFT_OUT}: {what}, {entry.mode.frequency_hz:g} Hz,{more} is "
        f"{100 * abs(math.expm1(deviation)):.2g} % {side} than expected from the other "
        f"{count - 1} tests{' and the tensions read' if read else ''}, which agree within "
        f"{100 * math.expm1(agree):.2g} %. Check the number of the mode"
        f"{' and the reading' if read else ''}, and repeat the test. If the hanger changed in "
        "between, take its tests one by one."
    )


def _name_contradictions(
    tests: Sequence[ModalTest], hanger: Hanger, limits: CheckLimits = _LIMITS
) -> list[str]:
    """Name the pair of tests that differ most beyond their errors, and how many more do."""
    worst: dict[tuple[str, str], tuple[float, _Entry, float]] = {}
    for group in _comparable(tests, hanger):
        for one, other in combinations(group, 2):
            # Frequencies that do not follow the tensions read are a gap, not a contradiction.
            if one.test.tension_read_n != other.test.tension_read_n and _has_reading(one):
                continue
            apart = abs(one.deviation - other.deviation)
            if apart < limits.gross_sd * hanger.assumptions.mode_scatter.value:
                continue
            sds = apart / _difference_sd(one, other, hanger)
            pair = one.test.id, other.test.id
            if sds > max(limits.gross_sd, worst[pair][0] if pair in worst else 0.0):
                worst[pair] = sds, one, apart
    if not worst:
        return []
    pair, (sds, entry, apart) = max(worst.items(), key=lambda each: each[1][0])
    more = f" So do {len(worst) - 1} more pairs." if len(worst) > 1 else ""
    return [
        f"Tests {pair[0]} and {pair[1]} contradict each other: {mode_name(entry.mode)} differs by "
        f"{100 * math.expm1(apart):.2f} % ({sds:.0f} standard deviations), more than their "
        f"conditions explain.{more} No steady cause explains both. If the hanger changed in "
        "between, take them one by one."
    ]


def _comparable(tests: Sequence[ModalTest], hanger: Hanger) -> Iterator[list[_Entry]]:
    """Yield the entries of each mode that tests with and without a reading or mass share."""
    groups: dict[str, list[_Entry]] = defaultdict(list)
    for test in tests:
        read = math.isfinite(test.tension_read_n)
        for mode in test.modes:
            if mode.irregular or not mode.frequency_hz > 0 or mode.order < 1:
                continue
            expected_hz = _expected_hz(mode.order, hanger, test.tension_read_n)
            if expected_hz > 0:
                deviation = math.log(mode.frequency_hz / expected_hz)
                key = repr((mode.plane, mode.order, test.added_mass, read))
                groups[key].append(_Entry(test, mode, deviation))
    yield from groups.values()


def _difference_sd(one: _Entry, other: _Entry, hanger: Hanger) -> float:
    """Return the standard deviation of the difference of two entries, as a fraction.

    It allows for identification, scatter from test to test, temperature, amplitude and readings.
    """
    assumed = hanger.assumptions
    parts = [math.sqrt(2) * assumed.mode_scatter.value]
    for each in (one, other):
        frequency_hz = each.mode.frequency_hz
        if is_bare(each.mode):
            lower, upper = assumed.unstated_frequency_sd.bounds
            written_hz = 10.0 ** -_decimals(frequency_hz, _LIMITS)
            parts += [math.sqrt(lower * upper), written_hz / frequency_hz]
        else:
            parts.append(each.mode.frequency_sd_hz / frequency_hz)
        read_n = each.test.tension_read_n
        if math.isfinite(read_n) and read_n > 0:
            parts.append(reading_sd_n(each.test, assumed) / read_n / 2)
    per_kelvin = assumed.tension_per_kelvin_sd.value / 2
    warmer_k = one.test.temperature_c - other.test.temperature_c
    unknown_k = math.sqrt(2) * assumed.unknown_temperature_sd_k.value
    parts.append(per_kelvin * (warmer_k if math.isfinite(warmer_k) else unknown_k))
    if not _same_level(one.test.amplitude, other.test.amplitude):
        parts.append(MOST_SLOPE)
    return math.hypot(*parts)


def _has_reading(entry: _Entry) -> bool:
    return math.isfinite(entry.test.tension_read_n)


def _same_level(one: float, other: float) -> bool:
    """Return True where two amplitudes are about the same, or both unknown."""
    if math.isnan(one) or math.isnan(other):
        return math.isnan(one) and math.isnan(other)
    return not max(one, other) > SAME_LEVEL * min(one, other)
