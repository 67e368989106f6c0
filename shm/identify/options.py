"""Define the options of an identification.

Defaults suit a hanger hit by a soft hammer; others suit records made for their complete band.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from shm.errors import UsageError
from shm.values import NAN

NO_CROSS_CHECK, AUTO_CROSS_CHECK = "none", "auto"
PASSED = 0.4
"""Of the sampling rate: what anti-aliasing filters pass; above, modes may be images of others."""


@dataclass(frozen=True)
class IdentifyOptions:
    """Options of `identify`; raises UsageError where they contradict each other.

    `band_low_hz`, `band_high_hz`: modes outside are not looked for.
    `identifier`: a name of `IDENTIFIERS`.
    `block_rows`, `max_order`: size of the Hankel matrix in time lags and the highest model order;
    None lets the number of channels and the length of the ring-downs decide.
    `max_damping_ratio`: poles above are not modes of a hanger.
    `min_presence`: share of the model orders at which a mode must show.
    `max_frequency_sd`, `max_damping_sd`: largest standard deviations, as fractions; where nobody
    hit, frequencies may have twice that.
    `max_frequency_spread`, `max_damping_spread`: how far they may move over the model orders, as
    fractions; a fifth of it below three hits.
    `ambient_width`: where nobody hit, all four may be so many times what a record of that length
    tells of the mode at best; 0 keeps to the fixed limits. `ambient_s` is that length, which the
    identifier fills in.
    `min_collinearity`: smallest modal phase collinearity (1 is a real shape).
    `min_coherence`: smallest coherence at a resonance of a measured frequency response.
    `reference_force_n`: peak force of the reference level; NaN leaves the amplitude unknown.
    `window_time_constant_s`: of the exponential window already in a given frequency response.
    `estimator`: of the frequency response: `h1` (noise in the responses), `h2` (noise in the
    force), `hv` (noise in both).
    `cross_check`: name of a second identifier whose frequencies are compared, `none`, or `auto`:
    `pyoma2` of a structure without a model, `ssi` where `pyoma2` identifies, else none.
    `frequency_allowance`: standard deviation, as a fraction, of what differs from one test to the
    next without being seen within one (mounting of sensors, rest of the temperature): added to
    that of each frequency.
    `shape_allowance`: the same of a shape, as a share of its largest component.
    `mains_hz`: of the power grid. `disturbance_bands`: name, lowest and highest frequency in Hz of
    machines that are known to run near the bridge.
    """

    band_low_hz: float = 2.0
    band_high_hz: float = 100.0
    identifier: str = "ssi"
    block_rows: int | None = None
    max_order: int | None = None
    max_damping_ratio: float = 0.05
    min_presence: float = 0.4
    max_frequency_sd: float = 0.001
    max_damping_sd: float = 0.5
    max_frequency_spread: float = 0.001
    max_damping_spread: float = 0.5
    ambient_width: float = 4.0
    ambient_s: float = 0.0
    min_collinearity: float = 0.5
    min_coherence: float = 0.5
    reference_force_n: float = NAN
    window_time_constant_s: float = math.inf
    estimator: Literal["h1", "h2", "hv"] = "h1"
    cross_check: str = NO_CROSS_CHECK
    frequency_allowance: float = 0.0
    shape_allowance: float = 0.0
    mains_hz: float = 50.0
    disturbance_bands: tuple[tuple[str, float, float], ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.band_low_hz < self.band_high_hz:
            raise UsageError(
                f"band {self.band_low_hz:g} to {self.band_high_hz:g} Hz is empty.",
                remedy="Give band_low_hz below band_high_hz.",
            )
        for name, low in (("block_rows", 5), ("max_order", 2)):
            value = getattr(self, name)
            if value is not None and value < low:
                raise UsageError(
                    f"{name} = {value} is too small.",
                    remedy=f"Give at least {low}, or leave it out.",
                )

    def passed_at(self, sampling_rate_hz: float) -> IdentifyOptions:
        """Return self, without that part of the band that a logger of that rate does not pass.

        Where none is left, the band stays, for whoever takes the record to refuse.
        """
        high_hz = min(self.band_high_hz, PASSED * sampling_rate_hz)
        return replace(self, band_high_hz=high_hz) if high_hz > self.band_low_hz else self

    def at_best(self, frequency_hz: float, damping_ratio: float) -> tuple[float, float]:
        """Return the least relative standard deviations of frequency and damping; 0 with hits.

        The Cramer-Rao bounds of a mode that white noise moves, damping small: sqrt(z / (w
        T)) and 1 / sqrt(z w T) (W. Gersch, J. Sound Vib. 36, 1974; S. K. Au, Mech. Syst.
        Signal Process. 48, 2014).
        """
        if self.ambient_s <= 0 or not damping_ratio > 0:
            return 0.0, 0.0
        radians = 2 * math.pi * frequency_hz * self.ambient_s
        return math.sqrt(damping_ratio / radians), 1 / math.sqrt(damping_ratio * radians)
