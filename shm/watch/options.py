"""What the watch over time takes for granted before any test."""

from __future__ import annotations

from dataclasses import dataclass

from shm.errors import UsageError


@dataclass(frozen=True)
class WatchOptions:
    """Limits and priors of the sequential test.

    `limit_years` is the mean time to a false call of one hanger, or less than it. The `scatter`
    tuples are what tests may differ by beyond what identification explains: fractions of the
    tension, and shares of a spring's `step_sd`; which pair of them holds is learnt.
    Temperature coefficients have mean 0 and the sds given, of the tension a fraction per kelvin, of
    a spring a share of its `step_sd` per kelvin; likewise per unit of log amplitude, of the bending
    stiffness a share. The first `baseline_tests` readings are taken to
    precede every change. `beginnings` is how many possible beginnings of a change are kept.
    `most_of_one_test` is the share of the limit that no test exceeds by itself, however wild.
    """

    limit_years: float = 100.0
    change_rate_per_year: float = 0.02
    outlier_probability: float = 0.01
    tension_scatter: float = 0.005
    spring_scatter_of_step: float = 0.1
    bending_scatter: float = 0.003
    clock_scatter: float = 1e-4
    mode_scatter: float = 5e-4
    scatter_scales: tuple[float, ...] = (0.6, 1.0, 1.6, 2.6)
    tension_per_kelvin_sd: float = 0.001
    spring_per_kelvin_sd_of_step: float = 0.1
    tension_per_amplitude_sd: float = 0.002
    spring_per_amplitude_sd_of_step: float = 0.1
    bending_per_amplitude_sd: float = 0.05
    creep_per_year_sd: float = 0.002
    unknown_temperature_sd_k: float = 10.0
    thermometer_sd_k: float = 1.5
    unknown_log_amplitude_sd: float = 0.5
    least_frequency_shift: float = 0.006
    most_of_one_test: float = 0.2
    baseline_tests: int = 1
    beginnings: int = 60

    def __post_init__(self) -> None:
        if not self.scatter_scales:
            raise UsageError("The watch needs one scale of the scatter at least.")
        if self.baseline_tests < 1:
            raise UsageError("The watch needs one baseline test at least.")
        if not 0 < self.outlier_probability < 1:
            raise UsageError("The probability of an outlier must lie between 0 and 1.")
        if self.limit_years <= 0 or self.change_rate_per_year <= 0:
            raise UsageError("The watch's limit and rate of changes must be more than 0.")
