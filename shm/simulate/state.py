"""Define the planted state of the hanger, and the plan of the measurement."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shm.errors import UsageError
from shm.values import NAN, Hanger, Plane

# Fractions of the length that no node of the first eight modes of a pinned or clamped bar meets.
_SENSORS = (0.21, 0.37)
_MORE_SENSORS = (0.29, 0.13, 0.45, 0.08, 0.33, 0.25)
_HAMMER = 0.16


def spread_places_m(hanger: Hanger, sensors: int) -> tuple[float, ...]:
    """Return the positions of 1 to 8 sensors within reach of the deck end."""
    shares = (*_SENSORS, *_MORE_SENSORS)
    _refuse_unless(1 <= sensors <= len(shares), f"1 to {len(shares)} sensors are possible")
    return tuple(sorted(share * hanger.length_m for share in shares[:sensors]))


@dataclass(frozen=True)
class HangerState:
    """The truth that is planted: tension, end springs (k1, k3 transverse; k2, k4 longitudinal).

    k1 and k2 act at the deck end, k3 and k4 at the arch end; infinite means clamped, 0 pinned.
    `length_m` is the effective length from the deck end; NaN means the hanger's own.
    """

    tension_n: float
    k1_n_m_rad: float = math.inf
    k2_n_m_rad: float = math.inf
    k3_n_m_rad: float = math.inf
    k4_n_m_rad: float = math.inf
    damping_ratio: float = 0.001
    length_m: float = NAN

    def springs_n_m_rad(self, plane: Plane) -> tuple[float, float]:
        """Return deck-end and arch-end spring of a plane."""
        if plane == "transverse":
            return self.k1_n_m_rad, self.k3_n_m_rad
        return self.k2_n_m_rad, self.k4_n_m_rad

    def effective_length_m(self, hanger: Hanger) -> float:
        return hanger.length_m if math.isnan(self.length_m) else self.length_m


@dataclass(frozen=True)
class HammerPlan:
    """Define the measurement: hits, sensors, logger.

    Each place of `sensors_x_m` holds a biaxial accelerometer (two channels); empty means 0.21
    and 0.37 of the hanger's length. A NaN `hammer_x_m` means 0.16 of it. `hammer_angle_deg` is
    0 for a transverse and 90 for a longitudinal hit. Each hit falls `pre_trigger_s` after the
    start of its slot, later by up to `hit_time_scatter_s`; its peak scatters log-normally. The
    half-sine pulse lasts `pulse_seconds`. Noise is white, as standard deviations; the converter
    has `adc_bits` over plus and minus its range and clips beyond.
    """

    hits: int = 5
    seconds_per_hit: float = 20.0
    sampling_rate_hz: float = 512.0
    sensors_x_m: tuple[float, ...] = ()
    hammer_x_m: float = NAN
    hammer_angle_deg: float = 45.0
    peak_force_n: float = 2000.0
    peak_force_scatter: float = 0.15
    pulse_seconds: float = 0.004
    pre_trigger_s: float = 0.5
    hit_time_scatter_s: float = 0.2
    acceleration_noise_m_s2: float = 0.002
    force_noise_n: float = 0.5
    adc_bits: int = 24
    force_range_n: float = 10_000.0
    acceleration_range_m_s2: float = 200.0

    def sensor_places_m(self, hanger: Hanger) -> tuple[float, ...]:
        return self.sensors_x_m or tuple(share * hanger.length_m for share in _SENSORS)

    def hammer_place_m(self, hanger: Hanger) -> float:
        return _HAMMER * hanger.length_m if math.isnan(self.hammer_x_m) else self.hammer_x_m

    @property
    def samples_per_hit(self) -> int:
        return round(self.seconds_per_hit * self.sampling_rate_hz)

    @property
    def samples(self) -> int:
        return self.hits * self.samples_per_hit


def check(hanger: Hanger, state: HangerState, plan: HammerPlan) -> None:
    """Check the figures of a state and of a plan; raises UsageError where one cannot be."""
    _refuse_unless(math.isfinite(state.tension_n), "the tension must be a finite number")
    _refuse_unless(0 <= state.damping_ratio < 1, "the damping ratio must lie from 0 to below 1")
    springs = (state.k1_n_m_rad, state.k2_n_m_rad, state.k3_n_m_rad, state.k4_n_m_rad)
    _refuse_unless(all(k >= 0 for k in springs), "springs must not be negative")
    length = state.effective_length_m(hanger)
    _refuse_unless(0 < length < math.inf, "the effective length must be positive")
    together = sum(each.length_m for each in hanger.turnbuckles)
    _refuse_unless(
        together < length,
        f"the effective length must exceed that of the turnbuckles, {together:g} m",
    )
    places = (*plan.sensor_places_m(hanger), plan.hammer_place_m(hanger))
    inside = all(0 < place < length for place in places)
    _refuse_unless(inside, f"sensors and hammer must stand between 0 and {length:g} m")
    _refuse_unless(plan.hits >= 1, "at least one hit is needed")
    _refuse_unless(2 <= plan.adc_bits <= 32, "the converter must have 2 to 32 bits")
    positive = (
        plan.seconds_per_hit, plan.sampling_rate_hz, plan.pulse_seconds, plan.peak_force_n,
        plan.force_range_n, plan.acceleration_range_m_s2,
    )  # fmt: skip
    _refuse_unless(all(0 < x < math.inf for x in positive), "durations and ranges must be positive")
    _check_levels(plan)


def _check_levels(plan: HammerPlan) -> None:
    levels = (
        plan.acceleration_noise_m_s2, plan.force_noise_n, plan.peak_force_scatter,
        plan.pre_trigger_s, plan.hit_time_scatter_s,
    )  # fmt: skip
    _refuse_unless(all(0 <= x < math.inf for x in levels), "noise and scatter must be 0 or more")
    last = plan.pre_trigger_s + plan.hit_time_scatter_s + plan.pulse_seconds
    _refuse_unless(last < plan.seconds_per_hit, "each hit must fall within its own seconds")


def _refuse_unless(condition: bool, what: str) -> None:
    if not condition:
        raise UsageError(
            f"cannot simulate: {what}.", remedy="Correct the state or the plan of the test."
        )
