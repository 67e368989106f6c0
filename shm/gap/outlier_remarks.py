"""Gross errors in words, and among the residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.gap.contract import Fit
from shm.gap.outliers import Cleared, GrossError
from shm.values import NAN, PLANES, Outlier, Residual, effect_label


def describe_outliers(
    found: Cleared, errors: Sequence[GrossError], fit: Fit
) -> tuple[Outlier, ...]:
    """Return gross errors with the frequencies that `fit`, the answer, expects in their place."""
    return tuple(_outlier(found, each, fit) for each in errors)


def _outlier(found: Cleared, error: GrossError, fit: Fit) -> Outlier:
    design, observations = found.whole.design, found.whole.observations
    deviation, sd = found.expected(error, fit)
    measured_hz = float(np.exp(observations.value[error.row]))
    expected_hz = measured_hz * float(np.exp(-deviation))
    own = float(np.nan_to_num(observations.sd[error.row]))
    return Outlier(
        plane=PLANES[design.frequency_plane[error.row]],
        order=int(design.frequency_order[error.row]),
        test=design.conditions[design.frequency_test[error.row]].test,
        measured_hz=measured_hz,
        expected_hz=expected_hz,
        expected_sd_hz=expected_hz * float(np.sqrt(max(sd**2 - own**2, 0.0))),
        probability=error.probability,
        acts_alone=found.acts_alone(error, fit) if error in found.aside else 0.0,
    )


def residuals_with_outliers(
    found: Cleared, kept: Sequence[Residual], before: Fit, after: Fit | None
) -> tuple[Residual, ...]:
    """Return the residuals of the frequencies `kept` and of those set aside, in their order.

    These have no share in the misfit, since it is that of the others.
    """
    rows = dict(zip(found.rows.tolist(), kept, strict=True))
    rows |= {each.row: _residual(found, each, before, after) for each in found.aside}
    return tuple(rows[row] for row in sorted(rows))


def _residual(found: Cleared, error: GrossError, before: Fit, after: Fit | None) -> Residual:
    (told,) = describe_outliers(found, [error], before)
    deviation, sd = found.expected(error, before)
    left = NAN if after is None else found.expected(error, after)[0]
    percent, after_percent = (100 * float(np.expm1(each)) for each in (deviation, left))
    own = told.plane, told.order, told.test, told.measured_hz, told.expected_hz
    return Residual(*own, percent, deviation / sd, 0.0, after_percent)


def describe_set_aside(found: Cleared, outliers: Sequence[Outlier]) -> tuple[str, ...]:
    """Return remarks on frequencies that were done without."""
    otherwise = _led_before(found)
    told = tuple(
        f"{_measured(each)}, is set aside as a gross error (probability {_probability(each)}): "
        f"{_expected(each)}. A wrong mode, a tone or a slip; look at the recording again."
        f"{_acts_alone(each)}"
        for each in outliers
    )
    if not told or not otherwise:
        return told
    right = "it prove right" if len(told) == 1 else "they prove right"
    return (*told, f"Should {right}, {otherwise} is the likeliest cause: repeat the test.")


def describe_doubtful(outliers: Sequence[Outlier]) -> tuple[str, ...]:
    """Return remarks on frequencies that may be gross errors, but were kept."""
    return tuple(
        f"{_measured(each)}, may be a gross error (probability {_probability(each)}): "
        f"{_expected(each)}. It is kept, and the answer may lean on it; look at the recording "
        f"again."
        for each in outliers
    )


def _acts_alone(outlier: Outlier) -> str:
    if not outlier.acts_alone:
        return ""
    return (
        f" Or a part that only this mode's swing reaches, such as a guide with play or a crack "
        f"that opens ({outlier.acts_alone:.2f}): test again with softer and with harder hits."
    )


def _measured(outlier: Outlier) -> str:
    mode = f"{outlier.plane.capitalize()} {outlier.order} of test {outlier.test}"
    return f"{mode}, {outlier.measured_hz:g} Hz"


def _expected(outlier: Outlier) -> str:
    sd_hz = outlier.expected_sd_hz
    digits = max(0, 1 - math.floor(math.log10(sd_hz))) if sd_hz > 0 else 3
    return f"the other data expect {outlier.expected_hz:.{digits}f} +- {sd_hz:.{digits}f} Hz"


def _probability(outlier: Outlier) -> str:
    return f"{outlier.probability:.2f}" if outlier.probability < 0.995 else "over 0.99"


def _led_before(found: Cleared) -> str:
    """Return the effect that led with all frequencies, if it leads no more, and where it acts.

    Pairs are none: among many there always is one that takes a gross error for its own.
    """
    led = found.first.leading if found.first else None
    leads = found.attribution.leading
    if led is None or led.is_pair or (leads and leads.effect == led.effect):
        return ""
    return effect_label(led.effect, led.best.hypothesis.at)
