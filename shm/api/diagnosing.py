"""Why model and measurement differ."""

from __future__ import annotations

from collections.abc import Sequence

from shm.api.reading import Tests, modal_tests
from shm.gap import GapOptions, Progress
from shm.gap import diagnose as diagnosed
from shm.gap.contract import silent
from shm.values import Diagnosis, Hanger

_DEFAULT = GapOptions()


def diagnose(
    tests: Tests,
    hanger: Hanger,
    baseline: str = _DEFAULT.baseline,
    *,
    without: Sequence[str] = _DEFAULT.without,
    hold_out: Sequence[str] = _DEFAULT.hold_out,
    draws: int = _DEFAULT.draws,
    seed: int = _DEFAULT.seed,
    progress: Progress = silent,
) -> Diagnosis:
    """Where the baseline and the tests of a hanger differ, which effect causes it, what it changes.

    `baseline` is the model class whose gap is diagnosed. `without` are effects taken out of the
    catalogue; `hold_out` what is left out of the fit and predicted: ids of tests or orders of modes
    (empty: every one in turn). `draws` are kept of each posterior. `progress` hears a label and the
    fraction done.

    The probabilities of `Diagnosis.causes`, of no gap and of something unknown add to 1;
    `Diagnosis.leading` is the likeliest cause, None where none leads; tensions are in N, residuals
    in percent of a frequency. Raises BadInput where the tests cannot be used, UsageError for a
    model class, effect, test or order that is not there.

    Example:
        >>> diagnosis = shm.diagnose(tests, hanger, baseline="beam1")
        >>> diagnosis.leading.effect
        'point_mass'
    """
    options = GapOptions(baseline, tuple(without), tuple(hold_out), draws, seed)
    return diagnosed(modal_tests(tests), hanger, options, progress)
