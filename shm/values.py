"""The nouns that flow between the steps: frozen, complete at birth, SI units in their names.

Arrays are numpy arrays whose shapes stand beside them. An unknown number is NaN, an unknown thing
is None; neither is ever 0. Times are timezone-aware UTC. `x_m` runs along the hanger from the deck
end (0) to the arch end (its length).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
ComplexArray: TypeAlias = NDArray[np.complex128]
Plane: TypeAlias = Literal["transverse", "longitudinal"]
Quantity: TypeAlias = Literal["force", "acceleration"]
Verdict: TypeAlias = Literal["good", "warning", "refused", "unknown"]

PLANES: tuple[Plane, Plane] = ("transverse", "longitudinal")
NAN = math.nan


@dataclass(frozen=True)
class Thresholds:
    """How large a shift of this hanger matters, and how sure one must be to say so."""

    tension_shift_fraction: float = 0.05
    stiffness_shift_decades: float = 0.5
    alert_probability: float = 0.95


@dataclass(frozen=True)
class EndPlate:
    """The plate welded to each end of a round rod, which is slotted into it over `slot_m`.

    Its width goes linearly from `end_width_m` at the end face to `neck_width_m`. The deck-end
    plate lies along the bridge, the arch-end plate across it. Springs on the end faces' edges are
    given per node; the nodes are `edge_node_spacing_m` apart.
    """

    length_m: float
    thickness_m: float
    end_width_m: float
    neck_width_m: float
    slot_m: float
    edge_node_spacing_m: float


@dataclass(frozen=True)
class Turnbuckle:
    """A coupler in the bar, centred at `x_m`; its mass and stiffness replace the bar's there."""

    x_m: float
    length_m: float
    mass_kg: float
    bending_stiffness_n_m2: float


@dataclass(frozen=True)
class Scatter:
    """Standard deviations, as fractions, by which a bar as made differs from its description."""

    section: float = 0.005
    density: float = 0.005
    length: float = 0.005
    modulus: float = 0.005


@dataclass(frozen=True)
class EffectPrior:
    """The owner's range of one parameter of an effect of the gap diagnosis, in its unit."""

    effect: str
    parameter: str
    lower: float
    upper: float


@dataclass(frozen=True)
class Hanger:
    """One hanger as its owner describes it: geometry, material, nominal tension.

    `diameter_m` is NaN where the section is not round. `bending_stiffness_factor` is the share of
    the solid section's bending stiffness that a strand has. `models` names the model classes that
    the owner admits; empty: all that the settings name. `effect_priors` replace ranges of the
    catalogue of effects.
    """

    id: int
    length_m: float
    elastic_modulus_pa: float
    area_m2: float
    second_moment_m4: float
    mass_per_length_kg_m: float
    nominal_tension_n: float
    name: str = ""
    thresholds: Thresholds = field(default_factory=Thresholds)
    diameter_m: float = NAN
    poissons_ratio: float = 0.3
    bending_stiffness_factor: float = 1.0
    plate: EndPlate | None = None
    turnbuckles: tuple[Turnbuckle, ...] = ()
    models: tuple[str, ...] = ()
    scatter: Scatter = field(default_factory=Scatter)
    effect_priors: tuple[EffectPrior, ...] = ()

    @property
    def bending_stiffness_n_m2(self) -> float:
        return self.elastic_modulus_pa * self.second_moment_m4 * self.bending_stiffness_factor


@dataclass(frozen=True, eq=False)
class Channel:
    """One sensor of a recording; `values` has shape (samples,), in N or m/s^2, NaN where bad.

    `full_scale` is the largest value that sensor and logger can record, NaN where nobody says.
    """

    name: str
    quantity: Quantity
    values: FloatArray
    plane: Plane | None = None
    x_m: float = NAN
    full_scale: float = NAN


@dataclass(frozen=True, eq=False)
class Recording:
    """Accelerations over time, as received, with the hammer's force unless nobody hit.

    One file, one or many hits. The force channel's `x_m` and `plane` say where and in which
    direction the hammer hit.
    """

    source: str
    channels: tuple[Channel, ...]
    sampling_rate_hz: float
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN

    @property
    def force(self) -> Channel | None:
        return next((c for c in self.channels if c.quantity == "force"), None)

    @property
    def accelerations(self) -> tuple[Channel, ...]:
        return tuple(c for c in self.channels if c.quantity == "acceleration")

    @property
    def samples(self) -> int:
        return len(self.channels[0].values) if self.channels else 0

    @property
    def duration_s(self) -> float:
        return self.samples / self.sampling_rate_hz


@dataclass(frozen=True)
class ResponsePoint:
    """Where a response was measured, or (roving hammer, by reciprocity) where it was excited."""

    name: str
    plane: Plane | None = None
    x_m: float = NAN


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Accelerance of each response to the hammer force.

    `frequency_hz` (lines,), evenly spaced from 0; `accelerance` (points, lines), complex, in
    m/s^2/N; `coherence` (points, lines) or None where the averages are not known.
    """

    source: str
    points: tuple[ResponsePoint, ...]
    frequency_hz: FloatArray
    accelerance: ComplexArray
    coherence: FloatArray | None = None
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN


@dataclass(frozen=True)
class ShapePoint:
    """A mode shape at one place: `value` in the mode's plane, `cross` in the other plane."""

    x_m: float
    value: float
    cross: float = NAN
    sd: float = NAN


@dataclass(frozen=True)
class Mode:
    """One identified mode. `order` counts from 1 in each plane; standard deviations may be NaN.

    `acceleration_m_s2` is the amplitude with which it rings right after a hit, at the sensor that
    moves most (median over the hits).
    """

    plane: Plane
    order: int
    frequency_hz: float
    frequency_sd_hz: float = NAN
    damping_ratio: float = NAN
    damping_sd: float = NAN
    shape: tuple[ShapePoint, ...] = ()
    acceleration_m_s2: float = NAN


@dataclass(frozen=True)
class ForeignMode:
    """A resonance or tone in a test that is not a bending mode of the hanger, and why not.

    `kind`: `harmonic` (a multiple of another mode's frequency), `tone` (mains, a machine) or
    `deck` (the bridge or another neighbour moves the hanger).
    """

    kind: Literal["harmonic", "tone", "deck"]
    frequency_hz: float
    damping_ratio: float
    reason: str


@dataclass(frozen=True)
class QualityCheck:
    """One figure of a test's quality beside its limit, and what to do where it is not met.

    `value` and `limit` are in `unit` (empty: none); `found` says what was seen and where; `remedy`
    is what the crew should do, empty where the verdict is good. A figure that these records do not
    give is NaN and `unknown`; a test with a `refused` check is not identified.
    """

    name: str
    verdict: Verdict
    value: float
    limit: float
    unit: str
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class AddedMass:
    """A known mass clamped on the hanger for one test."""

    mass_kg: float
    x_m: float


@dataclass(frozen=True)
class ModalTest:
    """What one hammer test says about a hanger: its identified modes and the conditions."""

    id: str
    modes: tuple[Mode, ...]
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    amplitude: float = NAN
    added_mass: AddedMass | None = None


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent uniform priors: `lower` and `upper` have shape (parameters,)."""

    names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class PredictedFrequency:
    """A frequency with the uncertainty of the parameters (thesis 4.14) beside its measurement."""

    plane: Plane
    order: int
    mean_hz: float
    sd_hz: float
    measured_hz: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of one model class's parameters given modal tests, and its evidence.

    `samples` (samples, parameters) are equally weighted draws; `log_likelihood` (samples,).
    `most_probable` (parameters,) has the largest posterior density. `r_hat` compares independent
    batches of draws, the worst parameter (1 is converged). `method` is the way it was sampled:
    `tmcmc` or `textbook` from scratch, or from a known posterior `re-weighted` or by an `ensemble`.
    """

    model: str
    hanger: int | None
    names: tuple[str, ...]
    samples: FloatArray
    log_likelihood: FloatArray
    most_probable: FloatArray
    nominal_tension_n: float
    log_evidence: float
    log_evidence_sd: float
    effective_sample_size: float
    r_hat: float
    evaluations: int
    predicted: tuple[PredictedFrequency, ...]
    tests: tuple[str, ...]
    seed: int
    seconds: float
    method: str = "tmcmc"

    def parameter(self, name: str) -> FloatArray:
        """Samples of one parameter, shape (samples,)."""
        return self.samples[:, self.names.index(name)]

    @property
    def tension_n(self) -> FloatArray:
        """Samples of the tension, shape (samples,)."""
        return self.parameter("theta_F") * self.nominal_tension_n


@dataclass(frozen=True, eq=False)
class Selection:
    """Model classes compared on the same tests, most probable first."""

    posteriors: tuple[Posterior, ...]
    probabilities: tuple[float, ...]

    @property
    def selected(self) -> Posterior:
        return self.posteriors[0]


@dataclass(frozen=True)
class Drift:
    """How far one quantity has moved from its baseline, with the probability that it matters.

    `quantity` is `tension` (shift as a fraction of the baseline) or a parameter such as
    `log10_k1` (shift in decades); `probability` is that of a shift beyond `threshold`, up or down.
    """

    hanger: int
    test: str
    time: datetime
    quantity: str
    baseline: float
    value: float
    shift_mean: float
    shift_sd: float
    threshold: float
    probability: float


@dataclass(frozen=True)
class Alert:
    """A shift that its owner should know of. `key` makes its delivery idempotent."""

    key: str
    hanger: int
    test: str
    time: datetime
    message: str
    drifts: tuple[Drift, ...]


@dataclass(frozen=True)
class Residual:
    """How far one measured frequency lies from the baseline's best prediction of it.

    `residual_percent` is measured over predicted, less 1; `z` is in standard deviations of the
    identification and of what the baseline leaves open; `share` is its part of the misfit.
    `after_percent` is the same residual with the leading cause in the model, `held_out_percent`
    with that cause fitted without this mode (NaN where it was not held out).
    """

    plane: Plane
    order: int
    test: str
    measured_hz: float
    predicted_hz: float
    residual_percent: float
    z: float
    share: float
    after_percent: float = NAN
    held_out_before_percent: float = NAN
    held_out_after_percent: float = NAN


@dataclass(frozen=True)
class Trend:
    """How the gap grows with a condition: `temperature`, `amplitude`, `order`, `added mass`.

    `slope_percent` is the change of the mean residual over the condition's range, with its
    standard deviation; `share` is the part of the misfit that goes with the condition.
    """

    condition: str
    slope_percent: float
    slope_sd_percent: float
    share: float


@dataclass(frozen=True)
class GapPlace:
    """Where along the hanger a local cause of one `kind` would have to sit, and what it explains.

    `x_m` is the likeliest place, `low_m` to `high_m` holds it with 90 % probability were it of this
    kind; `share` is the part of the misfit that it explains. `profile` holds (x_m, density).
    """

    kind: str
    x_m: float
    low_m: float
    high_m: float
    share: float
    profile: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class EffectEstimate:
    """One parameter of a cause: posterior mean, standard deviation and 90 % interval, in `unit`."""

    name: str
    unit: str
    mean: float
    sd: float
    q05: float
    q95: float


@dataclass(frozen=True)
class Cause:
    """One effect of the catalogue, or a pair, as an explanation of the gap.

    `effect` is the name, or two joined by ` + `, and `at` where the likeliest variant acts.
    `log_bayes_factor` compares it with the baseline, averaged over its variants; `log_fit` is what
    the best fit gains in log likelihood and `log_occam` what its evidence pays for free parameters.
    `group` is the index of the group of causes that the data cannot tell apart, None for none.
    `method` is how far it was taken: `screened`, `normal` or `sampled`.
    """

    effect: str
    at: str
    probability: float
    log_bayes_factor: float
    log_fit: float
    log_occam: float
    parameters: tuple[EffectEstimate, ...]
    method: Literal["screened", "normal", "sampled"]
    group: int | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the catalogue that it holds, one or two."""
        return tuple(self.effect.split(" + "))


@dataclass(frozen=True)
class Shrinkage:
    """Root mean square of the frequency residuals before and after, in and out of the fit."""

    rms_before_percent: float
    rms_after_percent: float
    held_out_before_percent: float
    held_out_after_percent: float


@dataclass(frozen=True)
class TensionEstimate:
    """Posterior of the tension under one explanation: mean, sd and 90 % interval."""

    mean: float
    sd: float
    q05: float
    q95: float


@dataclass(frozen=True)
class NextMeasurement:
    """A measurement that would tell causes apart, and the log Bayes factor to expect of it."""

    what: str
    separates: tuple[str, str]
    expected_log_bayes_factor: float


@dataclass(frozen=True)
class Diagnosis:
    """Where a baseline and the measurements of a hanger differ, why, and what that changes.

    `causes` holds every effect that these data could show, best first, and the pairs that were
    tried; their probabilities, `no_gap_probability` and `unexplained_probability` add to 1.
    `fit_p_value` is the posterior predictive p-value of the leading explanation. `invisible` names
    the effects that these data cannot show, and why; `left_out` those that were taken out of the
    catalogue. `remarks` say in words what is wrong with the data and what it does to the answer.
    """

    hanger: int | None
    baseline: str
    tests: tuple[str, ...]
    where: tuple[Residual, ...]
    trends: tuple[Trend, ...]
    places: tuple[GapPlace, ...]
    no_gap_probability: float
    unexplained_probability: float
    causes: tuple[Cause, ...]
    groups: tuple[tuple[str, ...], ...]
    invisible: tuple[tuple[str, str], ...]
    left_out: tuple[str, ...]
    fit_p_value: float
    model_error_percent: float
    shrinkage: Shrinkage
    tension_before_n: TensionEstimate
    tension_after_n: TensionEstimate
    next_measurements: tuple[NextMeasurement, ...]
    remarks: tuple[str, ...]
    seed: int
    seconds: float

    @property
    def leading(self) -> Cause | None:
        """The likeliest cause; None where no gap or something unknown is likelier than each."""
        best = max(self.causes, key=lambda cause: cause.probability, default=None)
        rest = max(self.no_gap_probability, self.unexplained_probability)
        return best if best is not None and best.probability > rest else None
