"""List the causes of a change of frequencies: the hypotheses of the diagnosis, over time.

Tension and end stiffness move the frequencies as the model class says, where the hanger is now.
The other causes are one column a place, by the general bar on the ends of the baseline. What none
of these does is "unexplained": every mode individually.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from shm.models import Model
from shm.models.classes.end_effects import coupled_bar
from shm.models.hanger import PointMass, solve
from shm.models.hanger.physical import Zone
from shm.values import PLANES, TENSION, End, FloatArray, Hanger, IntArray, WatchedQuantity
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import WatchOptions
from shm.watch.engine.quantities import MeasuredMode


@dataclass(frozen=True, eq=False)
class Direction:
    """One way to change: `factor` (columns, r) maps r independent unit normals to the change.

    `columns` are the modes (n), then the watched quantities (q). `name` is the cause's, `members`
    the quantities that move. `log_prior` is that of this cause given a change, `may_ramp` whether
    it may come slowly.
    """

    name: str
    factor: FloatArray
    members: tuple[int, ...]
    log_prior: float
    may_ramp: bool = True


@dataclass(frozen=True, eq=False)
class DetectedChange:
    """A called change: the test at which it began, its time, and whether it goes on.

    `precision` (n + q, n + q) is that of its size before the tests after the call: which causes
    called it.
    """

    first: int
    years: float
    is_ramp: bool
    precision: FloatArray


@dataclass(frozen=True, eq=False)
class Layout:
    """The order of the columns of a test: `n` modes, `q` quantities, then covariates.

    `prior_sd` (columns,) are those of the null's parameters; the quantities' own columns are no
    part of it, since the modes' levels hold them.
    """

    n: int
    q: int
    prior_sd: FloatArray

    @property
    def null(self) -> IntArray:
        """The columns of the null."""
        covariates = np.arange(self.n + self.q, len(self.prior_sd))
        return np.concatenate([np.arange(self.n), covariates])

    @property
    def change(self) -> slice:
        """The columns of which a change is made."""
        return slice(0, self.n + self.q)


POINT_MASS, SECTION_LOSS, TIMEBASE = "point_mass", "section_loss", "timebase"
SPRINGS = "springs"
SENSOR_MASS, BENDING_STIFFNESS, UNEXPLAINED = "sensor_mass", "bending_stiffness", "unexplained"

# Judgement, from what owners of bridges report: most of what lasts are tension and joints; lamps,
# cables and sensors follow; what nobody thought of is as likely as any one of these.
_SHARES = {
    TENSION: 0.4,
    SPRINGS: 0.28,
    POINT_MASS: 0.07,
    SENSOR_MASS: 0.06,
    SECTION_LOSS: 0.04,
    BENDING_STIFFNESS: 0.03,
    TIMEBASE: 0.05,
    UNEXPLAINED: 0.07,
}
_SENSOR_PLACES = np.linspace(0.1, 0.9, 17)
_NOWHERE = np.empty(0)
_ENDS: tuple[End, ...] = ("deck", "arch")


@dataclass(frozen=True, eq=False)
class Columns:
    """The effects of causes on the log frequencies of the baseline's `modes` (n,).

    One unit or one sd of each: (places, r, n) by name.

    `sensors` (n, n) is the covariance that a test's sensors, put elsewhere each time, give,
    `loosening` the patterns (r, n) of each watched quantity that its step may have beside its mean,
    `slopes` (n, q) what each watched quantity does at the baseline.
    """

    modes: tuple[MeasuredMode, ...]
    by_cause: dict[str, FloatArray]
    sensors: FloatArray
    loosening: tuple[FloatArray, ...] = ()
    slopes: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


def mounted_kg(hanger: Hanger) -> float:
    """Return the mass of all sensors of one test, where nothing is stated of them."""
    assumed = hanger.assumptions
    return assumed.accelerometers_on_bar.value * assumed.accelerometer_mass_kg.rms


def columns_of(
    model: Model, base: FloatArray, hanger: Hanger, modes: Sequence[MeasuredMode]
) -> Columns:
    """Of the hanger at `base` (parameters,): its tension, on its end springs."""
    values = dict(zip(model.parameter_names, base.tolist(), strict=True))
    deck, arch = model.springs_n_m_rad(base[None])
    return _columns_on(
        hanger,
        values.get("theta_L", 1.0) * hanger.length_m,
        values["theta_F"] * model.hanger.nominal_tension_n,
        (*deck.ravel().tolist(), *arch.ravel().tolist()),
        tuple(modes),
    )


@lru_cache(maxsize=128)  # of each hanger's baseline, which every later test is read against
def _columns_on(
    hanger: Hanger,
    length: float,
    tension: float,
    springs: tuple[float, ...],
    modes: tuple[MeasuredMode, ...],
) -> Columns:
    one = np.ones(1)
    length_m, tension_n = length * one, tension * one
    ends = np.array(springs).reshape(2, 1, -1)
    bar = coupled_bar(hanger, length_m, tension_n).on_springs((ends[0], ends[1]))
    planes, orders = np.array([(PLANES.index(plane), order - 1) for plane, order in modes]).T

    def log_hz(physical: object) -> FloatArray:
        found = solve(physical, int(orders.max()) + 1, _NOWHERE, shapes=False)  # type: ignore[arg-type]
        return np.asarray(np.log(found.frequency_hz[0, planes, orders]))

    still = log_hz(bar)
    mass_kg = float(hanger.mass_per_length_kg_m * length_m[0])

    def by_mass(place: float, units: float = LIMITS.step_to) -> FloatArray:
        put_on_kg = units * LIMITS.mass_share * mass_kg
        laden = replace(bar, masses=(*bar.masses, PointMass(place * length_m, put_on_kg * one)))
        return (log_hz(laden) - still) / units

    def about(place: float) -> FloatArray:
        """At a place, and what the way to its neighbours adds: one sd (2, n)."""
        ways = -LIMITS.apart, 0, LIMITS.apart
        low, here, high = (by_mass(place + way, LIMITS.lamp_units) for way in ways)
        return np.array([here, (high - low) / 2 / math.sqrt(3)])

    def by_loss(place: float, extent: float) -> FloatArray:
        left = 1 - LIMITS.step_to * LIMITS.loss
        zone = Zone(
            start_m=(place - extent / 2) * length_m,
            end_m=(place + extent / 2) * length_m,
            stiffness_factor=left**2 * one,
            mass_factor=left * one,
        )
        return (log_hz(replace(bar, zones=(*bar.zones, zone))) - still) / LIMITS.step_to

    stiffer = replace(
        bar, bending_stiffness_n_m2=bar.bending_stiffness_n_m2 * (1 + LIMITS.causes_stiffer)
    )
    sensors = np.array([by_mass(place) for place in _SENSOR_PLACES])
    sensors = sensors * mounted_kg(hanger) / (LIMITS.mass_share * mass_kg)
    spread = sensors - sensors.mean(axis=0)
    return Columns(
        tuple(modes),
        {
            POINT_MASS: np.array([about(place) for place in LIMITS.places]),
            SECTION_LOSS: np.array([by_loss(*each) for each in LIMITS.stretches])[:, None],
            BENDING_STIFFNESS: (log_hz(stiffer) - still)[None, None],
            TIMEBASE: np.full((1, 1, len(modes)), LIMITS.clock),
        },
        spread.T @ spread / len(spread),
    )


@dataclass(frozen=True, eq=False)
class Structure:
    """The hypotheses of a hanger: the layout of columns, directions of change, and scatters.

    Tests scatter along the quantities' `slopes` (n, q) and along `scattering` (n, c) by variances
    (q + c,) that are learnt, `scatter_variance` before any test; each of `scales` (K,) times that.
    Along `wander` (n, w) they differ slowly: all within `wander_years` of one have it alike.
    Quantities go with the temperature by `thermal_laws` coefficients each, the second of frost.
    Where it is not `is_modelled`, each frequency counts: which of them matters no model says.
    """

    layout: Layout
    slopes: FloatArray
    directions: tuple[Direction, ...]
    scattering: FloatArray
    stiffening: FloatArray
    scatter_variance: FloatArray
    scales: FloatArray
    wander: FloatArray = field(default_factory=lambda: np.zeros((1, 0)))
    wander_years: float = 0.0
    thermal_laws: int = 1
    is_modelled: bool = True


def structure_of(
    quantities: Sequence[WatchedQuantity], columns: Columns, options: WatchOptions
) -> Structure:
    """Return the hypotheses of a hanger."""
    n = len(columns.modes)
    steps = np.array([each.step_sd for each in quantities])
    is_tension = np.array([each.name == TENSION for each in quantities])

    def each_sd(of_tension: float, of_step: float) -> FloatArray:
        return np.where(is_tension, of_tension, of_step * steps)

    per_kelvin = each_sd(options.tension_per_kelvin_sd, options.spring_per_kelvin_sd_of_step)
    per_amplitude = each_sd(
        options.tension_per_amplitude_sd, options.spring_per_amplitude_sd_of_step
    )
    last = [options.bending_per_amplitude_sd, options.creep_per_year_sd]
    strength, axes = np.linalg.eigh(columns.sensors)
    is_seen = strength > LIMITS.seen_of_sensors * strength[-1]
    sensors = axes[:, is_seen] * np.sqrt(strength[is_seen])
    stiffer = columns.by_cause[BENDING_STIFFNESS][0].T
    # A joint that gives for a day does so along what it does as it loosens.
    loosening = np.vstack([np.zeros((0, n)), *columns.loosening]).T
    gives = options.spring_scatter_of_step
    scatter_sd = np.concatenate(
        [
            each_sd(options.tension_scatter, gives),
            np.ones(loosening.shape[1] + sensors.shape[1]),
            [options.bending_scatter / LIMITS.causes_stiffer, options.clock_scatter],
            np.full(n, options.mode_scatter),
        ]
    )
    return Structure(
        layout=Layout(
            n, len(steps), np.concatenate([np.ones(n), steps, per_kelvin, per_amplitude, last])
        ),
        slopes=columns.slopes,
        directions=tuple(_directions(quantities, columns, sensors)),
        scattering=np.hstack([gives * loosening, sensors, stiffer, np.ones((n, 1)), np.eye(n)]),
        stiffening=stiffer[:, 0] / LIMITS.causes_stiffer,
        scatter_variance=scatter_sd**2,
        scales=np.array(options.scatter_scales),
    )


def _directions(
    quantities: Sequence[WatchedQuantity], columns: Columns, sensors: FloatArray
) -> list[Direction]:
    n, q = len(columns.modes), len(quantities)
    steps = np.array([each.step_sd for each in quantities])
    moves = _joint_moves(quantities)
    found = []

    def of_modes(factor: FloatArray) -> FloatArray:
        return np.vstack([factor, np.zeros((q, factor.shape[1]))])

    for members, root in moves:
        patterns = [columns.loosening[j] for j in members if columns.loosening]
        extra = np.vstack([np.zeros((0, n)), *patterns]).T
        of_quantities = np.vstack([np.zeros((n, len(members))), steps[:, None] * root])
        factor = np.hstack([of_quantities, of_modes(extra)])
        alone = members == (0,) and quantities[0].name == TENSION
        share = _SHARES[TENSION] if alone else _SHARES[SPRINGS] / max(len(moves) - 1, 1)
        name = TENSION if alone else SPRINGS
        found.append(Direction(name, factor, members, math.log(share)))
    if len(moves) == 1:
        found[0] = replace(found[0], log_prior=math.log(_SHARES[TENSION] + _SHARES[SPRINGS]))
    for cause in (POINT_MASS, SECTION_LOSS, BENDING_STIFFNESS, TIMEBASE):
        places = columns.by_cause[cause]
        log_prior = math.log(_SHARES[cause] / len(places))
        found += [
            Direction(cause, of_modes(place.T), (), log_prior, cause != TIMEBASE)
            for place in places
        ]
    # Sensors of two tests differ, each by its own.
    for cause, factor in ((SENSOR_MASS, math.sqrt(2) * sensors), (UNEXPLAINED, np.eye(n))):
        size = LIMITS.unexplained if cause == UNEXPLAINED else 1.0
        log_prior = math.log(_SHARES[cause])
        found.append(Direction(cause, of_modes(size * factor), (), log_prior, False))
    return found


def _joint_moves(quantities: Sequence[WatchedQuantity]) -> list[tuple[tuple[int, ...], FloatArray]]:
    """Members and their factor: each quantity alone; springs of one end, of both, with tension.

    A spring of which the data do not tell the end may belong to either. What is one spring alone,
    or the same springs again, is left out.
    """
    everything = range(len(quantities))
    springs = [j for j in everything if quantities[j].name != TENSION]
    of_ends = [[j for j in springs if quantities[j].end in (end, None)] for end in _ENDS]
    joint = dict.fromkeys(tuple(each) for each in (*of_ends, springs) if len(each) > 1)
    is_read_as_tension = any(len(quantities[j].parameters) > 1 for j in springs)
    mixed = [tuple(everything)] if joint and is_read_as_tension else []
    chosen = dict.fromkeys([*((j,) for j in everything), *joint, *mixed])
    return [(each, _root(each, springs, len(quantities))) for each in chosen]


def _root(members: tuple[int, ...], springs: Sequence[int], q: int) -> FloatArray:
    """A factor (q, members) of the covariance of shifts, in steps, of which `springs` are alike."""
    n = len(members)
    among = np.eye(n)
    similar = np.isin(members, springs)
    among[np.ix_(similar, similar)] += LIMITS.correlation * (1 - np.eye(int(similar.sum())))
    root = np.zeros((q, n))
    root[list(members)] = np.linalg.cholesky(among)
    return root
