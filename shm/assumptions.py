"""One table of what is assumed of hangers, sensors and measurements before any data.

Every physical default, prior and scatter is a row: `DEFAULTS` holds the product's, and a hanger has
those of its bridge (`Hanger.assumptions`), where `[assumptions]` of `bridge.toml` may replace rows.
Steps, tolerances and counts of draws are no assumptions and stay with the code that needs them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

JUDGEMENT = "judgement"
DEFAULT = "default"
FILE = "bridge.toml"


@dataclass(frozen=True)
class Assumption:
    """One row: a value with its standard deviation, or a range of values.

    A row has a `value`, or a range from `lower` to `upper`, or both; `sd` is the standard deviation
    of the value, and NaN where the value itself is one. What a row does not have is NaN. `least`
    and `most` bound what an owner may write, `least_sd` the standard deviation. `least_beta` is the
    smallest parameter that a Beta distributed row may have, NaN where it is not Beta distributed.
    `origin` says who stated it.
    """

    name: str
    value: float
    unit: str
    source: str
    reason: str
    sd: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    least: float = 0.0
    most: float = math.inf
    origin: str = DEFAULT
    least_sd: float = 0.0
    least_beta: float = math.nan

    @property
    def has_value(self) -> bool:
        """Return True where the row is a number, not only a range."""
        return not math.isnan(self.value)

    @property
    def has_sd(self) -> bool:
        """Return True where the value has a standard deviation."""
        return not math.isnan(self.sd)

    @property
    def most_sd(self) -> float:
        """Return the largest standard deviation that goes with the value."""
        if math.isnan(self.least_beta):
            return math.inf
        smaller = min(self.value, 1 - self.value)
        return math.sqrt(self.value * (1 - self.value) / (1 + self.least_beta / smaller))

    @property
    def has_range(self) -> bool:
        """Return True where the row has a lower and an upper end."""
        return not math.isnan(self.lower)

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the lower and the upper end of the range."""
        return self.lower, self.upper

    @property
    def rms(self) -> float:
        """Return the root mean square of what the value may be."""
        return math.hypot(self.value, self.sd)

    @property
    def decades(self) -> float:
        """Return the width of the range in powers of ten."""
        return math.log10(self.upper / self.lower)


@dataclass(frozen=True, repr=False)
class Assumptions(Mapping[str, Assumption]):
    """The table, frozen: rows by name (`table["poissons_ratio"]`) or as attributes.

    `overridden` are the rows that differ from the defaults, in the table's order.
    """

    overridden: tuple[Assumption, ...] = ()

    def __getitem__(self, name: str) -> Assumption:
        return _table(self.overridden)[name]

    def __getattr__(self, name: str) -> Assumption:
        if name in _NAMES:
            return self[name]
        raise AttributeError(f"there is no assumption {name!r}")

    def __iter__(self) -> Iterator[str]:
        return iter(_NAMES)

    def __len__(self) -> int:
        return len(_NAMES)

    def __repr__(self) -> str:
        stated = ", ".join(f"{row.name}={number_text(row)}" for row in self.overridden)
        return f"<Assumptions: {stated or 'the defaults'}>"

    def with_rows(self, *rows: Assumption) -> Assumptions:
        """Return the table with rows replaced by those of the same name.

        A row that is equal to the default but for its reason still counts as overridden.
        Raises KeyError for a name that the table does not have.
        """
        stated = {row.name: row for row in (*self.overridden, *rows)}
        for name in stated:
            _table(())[name]
        return Assumptions(tuple(stated[name] for name in _NAMES if name in stated))

    def with_numbers(self, origin: str = "code", **numbers: Any) -> Assumptions:
        """Return the table with values (a number) or ranges (a pair) replaced, by name.

        Example:
            >>> DEFAULTS.with_numbers(accelerometer_mass_kg=0.2).accelerometer_mass_kg.value
            0.2
        """
        rows = []
        for name, number in numbers.items():
            if isinstance(number, tuple):
                lower, upper = number
                rows.append(replace(self[name], lower=lower, upper=upper, origin=origin))
            else:
                rows.append(replace(self[name], value=float(number), origin=origin))
        return self.with_rows(*rows)

    def document(self) -> dict[str, dict[str, Any]]:
        """Return the overridden rows as a JSON document holds them, by name; often empty."""
        return {row.name: row_document(row) for row in self.overridden}


def row_document(row: Assumption) -> dict[str, Any]:
    """Return what a JSON document says of a row; numbers that it does not have are absent."""
    numbers = {"value": row.value, "sd": row.sd, "lower": row.lower, "upper": row.upper}
    return {
        **{key: number for key, number in numbers.items() if not math.isnan(number)},
        "unit": row.unit,
        "from": row.origin,
        "source": row.source,
        "reason": row.reason,
    }


def number_text(row: Assumption) -> str:
    """Return the numbers of a row in words: `0.05 ± 0.05`, `0.03 to 1000`."""
    words = []
    if row.has_value:
        words.append(f"{row.value:g}" + (f" ± {row.sd:g}" if row.has_sd else ""))
    if row.has_range:
        words.append(f"{row.lower:g} to {row.upper:g}")
    return ", ".join(words)


# The bar as it was made. What a hanger's `[hanger.scatter]` states goes before these.
_BAR = (
    Assumption(
        "section_sd",
        0.01,
        "fraction",
        "EN 10060",
        "Area of a bar as made over described. A hot-rolled round of 50 mm may be off by 0.8 mm, "
        "3.2 % of the area, which three standard deviations make 1.1 %.",
        most=0.5,
    ),
    Assumption(
        "section_along_sd",
        0.001,
        "fraction",
        "EN 10060",
        "By which the area varies along one bar about its mean: 0.05 mm of a diameter of 100 mm.",
        most=0.5,
    ),
    Assumption(
        "section_reach_m",
        1.0,
        "m",
        JUDGEMENT,
        "Distance over which the section of a rolled bar is alike.",
        least=1e-3,
        most=1000.0,
    ),
    Assumption(
        "density_sd",
        0.003,
        "fraction",
        "ASM Handbook 1",
        "By their composition carbon steels lie between 7,830 and 7,870 kg/m3.",
        most=0.5,
    ),
    Assumption(
        "modulus_sd",
        0.015,
        "fraction",
        "JCSS Probabilistic Model Code 3.2",
        "Between heats of one kind of steel, half of the 3 % that the code gives with the scatter "
        "of the tests.",
        most=0.5,
    ),
    Assumption(
        "length_sd",
        0.0005,
        "fraction",
        "OIML R 35",
        "A tape of class II and its reading between two ends: 5 mm in 10 m.",
        most=0.5,
    ),
    Assumption(
        "poissons_ratio",
        0.3,
        "1",
        "EN 1993-1-1, 3.2.6",
        "Structural steel. The key poissons_ratio of a hanger goes before it.",
        most=0.499,
    ),
    Assumption(
        "thermal_expansion_1_k",
        1.2e-5,
        "1/K",
        "EN 1993-1-1, 3.2.6",
        "Steel: what a held bar would gain or lose in strain with a kelvin.",
        most=1e-3,
    ),
    Assumption(
        "modulus_per_kelvin",
        -3e-4,
        "1/K",
        "Ledbetter and Reed (1973), Elastic properties of metals and alloys, I",
        "By which steel softens; bending frequencies go with half of it.",
        least=-1e-2,
        most=1e-2,
    ),
)

_TENSION = (
    Assumption(
        "tension_ratio",
        math.nan,
        "times nominal",
        JUDGEMENT,
        "Where a tension may lie at all: from slack to what no hanger was designed for.",
        lower=0.02,
        upper=5.0,
        least=1e-4,
        most=1e3,
    ),
    Assumption(
        "as_designed_share",
        0.9,
        "probability",
        JUDGEMENT,
        "Of hangers whose tension is about as designed; of the rest nothing is known. Where few "
        "modes of a short stiff bar hardly tell the tension, a uniform logarithm alone crowds its "
        "posterior at a slack bar.",
        most=0.999,
    ),
    Assumption(
        "as_designed_log_sd",
        math.log(1.4),
        "of the logarithm",
        JUDGEMENT,
        "Tension over nominal of those: a factor of 1.4. Lift-offs differ from the drawings by 5 "
        "to 30 %.",
        least=1e-3,
        most=5.0,
    ),
    Assumption(
        "tension_reading_sd",
        0.03,
        "fraction",
        "fib Bulletin 30, Acceptance of stay cable systems",
        "Of a load cell, lift-off or weight without a stated error: lift-offs repeat within 2 to "
        "5 %.",
        least=1e-6,
        most=0.5,
    ),
)

_ENDS = (
    Assumption(
        "end_restraint",
        math.nan,
        "k L/EI",
        JUDGEMENT,
        "Range of an end's rotational spring (its prior is the fixity of each kind of end; sensors "
        "that stay take its logarithm as uniform): below 0.03 a first frequency is within 0.3 % of "
        "the pinned bar's, above 1000 within 0.2 % of the clamped one's.",
        lower=0.03,
        upper=1000.0,
        least=1e-6,
        most=1e9,
    ),
    Assumption(
        "support_compliance_m_n",
        3.5e-9,
        "m/N",
        JUDGEMENT,
        "Of one support, sideways: gussets and chords of 1e8 to 1e9 N/m, or next to nothing.",
        sd=4e-9,
        most=1e-3,
    ),
    Assumption(
        "fitting_rigidity",
        0.6,
        "of a rigid one",
        JUDGEMENT,
        "What a fitting stiffens, over what one without curvature would: a thread in a nut has a "
        "fifth of it, a socket or a fork nearly all.",
        sd=0.3,
        most=2.0,
    ),
    Assumption(
        "fitting_mass",
        0.7,
        "of the bar's",
        JUDGEMENT,
        "Mass of a fitting beyond the bar's over its length: from threads to sockets.",
        sd=0.6,
        most=100.0,
    ),
    Assumption(
        "end_details_shared",
        0.5,
        "of the variance",
        JUDGEMENT,
        "What the details of one end have alike in both planes: a fork or a gusset has two faces.",
        most=1.0,
    ),
    Assumption(
        "end_details_model_error",
        0.1,
        "of the effect",
        "shm.models.end_effects compared with exact solutions",
        "By which the first order of an end's detail is wrong for each mode: 0.03 in the middle, "
        "0.2 at the worst.",
        most=1.0,
    ),
    Assumption(
        "fork_length",
        4.0,
        "diameters",
        JUDGEMENT,
        "Of a fork from pin to bar at most; how much of it swings is open (length_by = pins).",
        most=100.0,
    ),
    Assumption(
        "node_length",
        0.03,
        "of the length",
        JUDGEMENT,
        "Of a node plate with half a chord at most (length_by = nodes).",
        most=0.5,
    ),
)


def _rows_of_ends(
    kind: str,
    reason: str,
    fixity: tuple[float, float],
    clamped: float,
    stiffness: tuple[float, float],
    mass: tuple[float, float],
) -> tuple[Assumption, ...]:
    """Return the rows of one kind of end, each pair a value and its standard deviation."""
    return (
        Assumption(
            f"{kind}_fixity",
            fixity[0],
            "of the clamped moment",
            JUDGEMENT,
            f"{reason} Part of the moment of a clamped end that the end takes, k/(k + EI/L + "
            "sqrt(EI T)/2) of a spring k; Beta distributed.",
            sd=fixity[1],
            least=0.01,
            most=0.99,
            least_sd=1e-3,
            least_beta=0.2,
        ),
        Assumption(
            f"{kind}_clamped",
            clamped,
            "probability",
            JUDGEMENT,
            "That both ends hold so fast that no test would tell them from clamped ones.",
            least=1e-3,
            most=0.999,
        ),
        Assumption(
            f"{kind}_stiffness_log",
            stiffness[0],
            "ln of times the bar's",
            JUDGEMENT,
            f"Bending stiffness over `fittings_m`: {math.exp(stiffness[0]):.1f} times the bar's.",
            sd=stiffness[1],
            least=-10.0,
            most=10.0,
            least_sd=1e-3,
        ),
        Assumption(
            f"{kind}_mass_log",
            mass[0],
            "ln of times the bar's",
            JUDGEMENT,
            f"Mass over `fittings_m`: {math.exp(mass[0]):.1f} times the bar's.",
            sd=mass[1],
            least=-5.0,
            most=5.0,
            least_sd=1e-3,
        ),
    )


_KINDS_OF_ENDS = (
    *_rows_of_ends(
        "socket",
        "A cast or swaged socket is bolted or sits on its bearing.",
        *((0.833, 0.141), 0.3, (2.0, 0.7), (1.2, 0.4)),
    ),
    *_rows_of_ends(
        "welded",
        "A weld to a gusset holds fast.",
        *((0.833, 0.141), 0.4, (1.2, 0.9), (0.7, 0.5)),
    ),
    *_rows_of_ends(
        "plate",
        "An end plate is stiff in its plane and weaker across it.",
        *((0.75, 0.194), 0.3, (1.2, 0.9), (0.7, 0.5)),
    ),
    *_rows_of_ends(
        "threaded",
        "A nut on a thick plate holds nearly fast.",
        *((0.75, 0.194), 0.2, (0.5, 0.5), (0.4, 0.3)),
    ),
    *_rows_of_ends(
        "fork",
        "A fork turns about its pin in one plane and hardly in the other.",
        *((0.5, 0.323), 0.1, (1.5, 0.8), (0.8, 0.4)),
    ),
    *_rows_of_ends(
        "unstated",
        "From a hinge to a clamp, either more probable than the middle: Beta(1/2, 1/2).",
        *((0.5, 0.3536), 0.15, (1.2, 0.9), (0.7, 0.5)),
    ),
    Assumption(
        "similarity_of_ends",
        0.5,
        "correlation",
        JUDGEMENT,
        "Between the fixities of the ends and planes of one hanger, as normal scores: ends of one "
        "drawing are rarely each of another kind.",
        most=0.99,
    ),
    Assumption(
        "turnbuckle_stiffness_log_sd",
        0.25,
        "of the logarithm",
        JUDGEMENT,
        "Bending stiffness of a turnbuckle over the described one.",
        most=3.0,
    ),
    Assumption(
        "turnbuckle_mass_log_sd",
        0.15,
        "of the logarithm",
        JUDGEMENT,
        "Mass of a turnbuckle over the described one.",
        most=3.0,
    ),
)

_WEIGHT = (
    Assumption(
        "inclination_sd_deg",
        1.0,
        "deg",
        JUDGEMENT,
        "Of a stated `inclination_deg`: a level on a bar, and out of plumb.",
        most=20.0,
    ),
    Assumption(
        "usual_lean_deg",
        4.0,
        "deg",
        JUDGEMENT,
        "Lean from the vertical of a hanger without `inclination_deg`: half lean less, one in "
        "twenty more than four times as much.",
        least=0.1,
        most=45.0,
    ),
    Assumption(
        "sag_stiffness_log",
        -0.2,
        "ln of times EA/L",
        JUDGEMENT,
        "Axial stiffness against which sag changes: the bar's, and the supports' in series.",
        sd=0.3,
        least=-10.0,
        most=1.0,
        least_sd=1e-3,
    ),
)

_STRANDS = (
    Assumption(
        "strand_bending_factor",
        math.nan,
        "of the solid section",
        "Papailiou (1997), IEEE Trans. Power Delivery 12",
        "Bending stiffness of a strand at the small amplitudes of a test, unless `bending_factor` "
        "in [hanger.scatter] gives the standard deviation of the stated one.",
        lower=0.3,
        upper=1.0,
        least=1e-3,
        most=1.0,
    ),
    Assumption(
        "strand_bending_log_sd",
        0.3,
        "of the logarithm",
        "Papailiou (1997), IEEE Trans. Power Delivery 12",
        "Of the bending factor of a strand from its siblings' or its own that was learnt: 0.2 of "
        "0.65, the spread of a factor anywhere from 0.3 to 1.",
        least=1e-3,
        most=5.0,
    ),
    Assumption(
        "strand_shear_share",
        math.nan,
        "of a solid bar's",
        JUDGEMENT,
        "Shear of a strand: none, as of wires that each bend alone, to more than a bar's.",
        lower=0.0,
        upper=1.5,
        most=10.0,
    ),
)

_SENSORS = (
    Assumption(
        "accelerometer_mass_kg",
        0.05,
        "kg",
        "data sheets of makers",
        "Of one accelerometer with its magnet, base and the end of its cable: 20 to 90 g, seismic "
        "ones more, none where a laser looks on.",
        sd=0.05,
        most=50.0,
    ),
    Assumption(
        "accelerometers_on_bar",
        2.0,
        "accelerometers",
        JUDGEMENT,
        "In a test whose sensors' places are not stated: what they may do to a mode in the watch, "
        "where each test has them elsewhere.",
        most=20.0,
    ),
    Assumption(
        "accelerometer_most_of_bar",
        0.03,
        "of the bar's mass",
        JUDGEMENT,
        "Heavier accelerometers are not put on a bar: what is lighter is measured without touch.",
        least=1e-6,
        most=1.0,
    ),
    Assumption(
        "sensor_place_m",
        math.nan,
        "m",
        JUDGEMENT,
        "Of sensors whose places are not stated, from the deck: where a person mounts them, but "
        "never beyond the middle of the hanger.",
        lower=0.8,
        upper=2.5,
        most=1000.0,
    ),
    Assumption(
        "sensor_gain_sd",
        0.015,
        "fraction",
        "ISO 16063-21",
        "Three times what a calibration gives: with less, careless mounting passes for skewed axes "
        "or a mass, and with more these hide.",
        most=0.5,
    ),
    Assumption(
        "sensor_place_sd_m",
        0.01,
        "m",
        JUDGEMENT,
        "Of a stated place: three to five times what a tape gives.",
        most=0.5,
    ),
    Assumption(
        "sensor_turn_sd_deg",
        1.5,
        "deg",
        JUDGEMENT,
        "About the axis of the hanger: three to five times what a bubble level gives.",
        most=45.0,
    ),
    Assumption(
        "sensor_cross_axis_sd",
        0.02,
        "fraction",
        "PCB 352C33 (5 % at most) and similar data sheets",
        "What of one axis another reads, each axis on its own: about half of the 3 to 5 % that "
        "data sheets give as the most.",
        most=0.5,
    ),
    Assumption(
        "added_mass_radius_m",
        0.05,
        "m",
        JUDGEMENT,
        "Radius of gyration of a known mass clamped on for a test, where none is stated: clamps of "
        "half a kilogram to 25 kg are 5 to 20 cm long.",
        sd=0.03,
        most=1.0,
    ),
    Assumption(
        "clamp_gyration_m",
        0.1,
        "m",
        JUDGEMENT,
        "Radius of gyration of a clamp or coupler some 0.35 m long, whose length is sqrt(12) of "
        "it.",
        most=10.0,
    ),
)

_ERRORS = (
    Assumption(
        "unstated_frequency_sd",
        3e-4,
        "fraction",
        "docs/trials/identification_benchmarks.md for the lower end",
        "Of a frequency whose error nobody states and no second test shows: a hammer test reaches "
        "1e-4, usual identifications 1e-3, and the value lies midway. Where it is learnt from the "
        "data, the range goes on to peaks that are read off a plot by eye.",
        lower=1e-4,
        upper=3e-2,
        least=1e-7,
        most=0.3,
    ),
    Assumption(
        "stated_sd_log_sd",
        0.2,
        "of the logarithm",
        JUDGEMENT,
        "Of true over stated standard deviations of frequencies: 1/sqrt(2 (n - 1)) of one found in "
        "n = 13 hits.",
        least=1e-3,
        most=3.0,
    ),
    Assumption(
        "stated_sd_freedom",
        4.0,
        "degrees of freedom",
        JUDGEMENT,
        "Of the tails of the same: one in a hundred is off by a factor of 2.5, by a bias that hits "
        "share.",
        least=1.0,
        most=1e6,
    ),
    Assumption(
        "model_error",
        math.nan,
        "fraction",
        "tests/benchmarks/worlds.py",
        "Of each mode, the same in all tests: what no model has. From the error of a quartz to six "
        "times what sound hangers of others showed; the smaller, the wider the intervals of "
        "hangers that fit.",
        lower=1e-5,
        upper=3e-3,
        least=1e-7,
        most=0.1,
    ),
    Assumption(
        "largest_model_error",
        0.3,
        "fraction",
        JUDGEMENT,
        "To where the model error may go beyond its usual range: no tension is given any more.",
        least=0.15,
        most=1.0,
    ),
    Assumption(
        "usual_model_error_share",
        0.95,
        "probability",
        JUDGEMENT,
        "Of hangers whose model error lies in its usual range; a class that does not fit gets a "
        "wide posterior, not a sharp one at a wrong place.",
        least=0.01,
        most=0.999,
    ),
    Assumption(
        "model_error_shared",
        0.5,
        "of the variance",
        JUDGEMENT,
        "What neighbouring orders have alike, and half of that in the other plane: halfway between "
        "errors of each mode alone and one error of all.",
        most=0.99,
    ),
    Assumption(
        "model_error_reach",
        0.7,
        "of ln(order)",
        JUDGEMENT,
        "How far it goes together: about an octave, ln 2 (correlation 0.6).",
        least=0.01,
        most=100.0,
    ),
)

_DIAGNOSIS = (
    Assumption(
        "unstated_shape_sd",
        0.01,
        "of a unit shape",
        JUDGEMENT,
        "Of a mode shape that is still to be measured: twice that of simulated campaigns.",
        least=1e-5,
        most=1.0,
    ),
    Assumption(
        "tension_between_tests",
        0.001,
        "fraction",
        JUDGEMENT,
        "Of the tension from one test to another in the diagnosis: temperature and traffic change "
        "it by about as much, and nothing is wrong with the hanger.",
        least=1e-6,
        most=0.5,
    ),
    Assumption(
        "gross_error_share",
        0.01,
        "probability",
        "Hampel, Ronchetti, Rousseeuw and Stahel (1986), 1.2c",
        "Of a frequency to be a gross error. Of routine data 1 to 10 % are; modes that were chosen "
        "with care are taken to be the better end of that.",
        least=1e-6,
        most=0.5,
    ),
    Assumption(
        "overlap_of_peaks",
        0.004,
        "of the frequency",
        JUDGEMENT,
        "Frequencies of one order that are closer have peaks that overlap: twice the bandwidth at "
        "0.1 % of damping.",
        most=0.1,
    ),
    Assumption(
        "overlap_correlation",
        0.4,
        "correlation",
        JUDGEMENT,
        "Of the errors of such peaks, as likely as none: an identification of both planes together "
        "leaves none, that of each by itself shares what both sensors heard.",
        most=0.99,
    ),
)

_CHANGES = (
    Assumption(
        "change_rate_per_year",
        0.02,
        "1/year",
        JUDGEMENT,
        "How often a hanger changes for good.",
        least=1e-6,
        most=100.0,
    ),
    Assumption(
        "outlier_probability",
        0.01,
        "probability",
        JUDGEMENT,
        "Of a test to say nothing of its hanger.",
        least=1e-6,
        most=0.5,
    ),
    Assumption(
        "tension_scatter",
        0.005,
        "fraction",
        JUDGEMENT,
        "Of the tension from test to test of an unchanged hanger, beyond identification.",
        least=1e-6,
        most=0.5,
    ),
    Assumption(
        "spring_scatter_of_step",
        0.1,
        "of the step",
        JUDGEMENT,
        "Of an end spring from test to test, as a share of the change that is looked for.",
        least=1e-6,
        most=10.0,
    ),
    Assumption(
        "bending_scatter",
        0.003,
        "fraction",
        JUDGEMENT,
        "Of the bending stiffness from test to test.",
        least=1e-6,
        most=0.5,
    ),
    Assumption(
        "clock_scatter",
        1e-4,
        "fraction",
        JUDGEMENT,
        "Of a logger's time base from test to test.",
        least=1e-9,
        most=0.1,
    ),
    Assumption(
        "mode_scatter",
        5e-4,
        "fraction",
        JUDGEMENT,
        "Of each frequency by itself from test to test: a joint that gives, sensors elsewhere.",
        least=1e-7,
        most=0.1,
    ),
    Assumption(
        "tension_per_kelvin_sd",
        0.001,
        "1/K",
        JUDGEMENT,
        "Of the tension's temperature coefficient, about 0: a hanger whose bridge warms with it "
        "has a small share of what a held bar would have.",
        least=1e-7,
        most=0.1,
    ),
    Assumption(
        "spring_per_kelvin_sd_of_step",
        0.1,
        "of the step / K",
        JUDGEMENT,
        "Of an end spring's temperature coefficient, about 0.",
        least=1e-6,
        most=10.0,
    ),
    Assumption(
        "unknown_temperature_sd_k",
        10.0,
        "K",
        JUDGEMENT,
        "Of a temperature that was not measured, from the mean of those that were.",
        least=0.1,
        most=60.0,
    ),
    Assumption(
        "thermometer_sd_k",
        1.5,
        "K",
        JUDGEMENT,
        "A thermometer tells the air's temperature, which the steel follows in its own time.",
        most=60.0,
    ),
    Assumption(
        "tension_per_amplitude_sd",
        0.002,
        "1/ln(amplitude)",
        JUDGEMENT,
        "Of the tension's dependence on the level of motion, about 0.",
        least=1e-7,
        most=1.0,
    ),
    Assumption(
        "spring_per_amplitude_sd_of_step",
        0.1,
        "of the step / ln(amplitude)",
        JUDGEMENT,
        "Of an end spring's dependence on the level of motion, about 0: joints slip.",
        least=1e-6,
        most=10.0,
    ),
    Assumption(
        "bending_per_amplitude_sd",
        0.05,
        "1/ln(amplitude)",
        JUDGEMENT,
        "Of a bar's bending stiffness, by which it goes with the level of motion, about 0.",
        least=1e-6,
        most=10.0,
    ),
    Assumption(
        "unknown_log_amplitude_sd",
        0.5,
        "of the logarithm",
        JUDGEMENT,
        "Of a level of motion that was not measured.",
        least=1e-3,
        most=10.0,
    ),
    Assumption(
        "creep_per_year_sd",
        0.002,
        "1/year",
        JUDGEMENT,
        "Of the steady change of a tension, about 0.",
        least=1e-7,
        most=1.0,
    ),
)

_ROWS = (
    *_BAR,
    *_TENSION,
    *_ENDS,
    *_KINDS_OF_ENDS,
    *_WEIGHT,
    *_STRANDS,
    *_SENSORS,
    *_ERRORS,
    *_DIAGNOSIS,
    *_CHANGES,
)
_NAMES = tuple(row.name for row in _ROWS)


@cache
def _table(overridden: tuple[Assumption, ...]) -> dict[str, Assumption]:
    return {row.name: row for row in (*_ROWS, *overridden)}


DEFAULTS = Assumptions()
