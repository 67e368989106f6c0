"""The posterior of one model class, and the choice among several."""

from __future__ import annotations

from collections.abc import Sequence

from shm.api.reading import Tests, modal_tests
from shm.inference import METHODS, Progress, UpdateOptions, updating
from shm.models import DESCRIPTION, build, competing_names
from shm.settings import load_settings
from shm.values import Hanger, Posterior, Selection


def update(
    tests: Tests,
    hanger: Hanger,
    model: str = "beam2",
    *,
    seed: int = 1,
    samples: int = 1000,
    repeat: int = 1,
    method: str = METHODS[0],
    priors: str = DESCRIPTION,
    progress: Progress = updating.silent,
) -> Posterior:
    """The posterior of tension and end stiffness of one model class, given all modes of `tests`.

    `model` is a name of `shm.models.MODELS` (`beam1`, `beam2`, `beam3`, `s1`, `s2`, `solid0`,
    `solid1`, `solid2`), or a baseline with an adopted effect (`beam1+point_mass@everywhere`).
    `priors` say what is possible before the test: by the hanger's `description` (tension from slack
    to 5 times nominal, ends from pinned to clamped, the tolerances of its `scatter`), or by the
    `thesis`: its ranges, an exact description and f_hat ~ N(f(theta), (sigma f_hat)^2 + sd^2),
    thesis (4.5), with the unknown fractional model error sigma and the identification's standard
    deviation sd. With the thesis's, `repeat` counts the data set N_D times and `method` may be any
    of `shm.inference.METHODS`. `progress` hears a label and the fraction done.

    `Posterior.samples` (samples, parameters) are equally weighted draws, `Posterior.tension_n`
    (samples,) is in N; its interval is absolute, `Posterior.repeatability_sd_n` is for shifts and
    `Posterior.caveats` say what keeps it from being taken at its word. Raises UsageError where the
    class does not apply to the hanger, BadInput where a test has no modes or conditions that the
    class cannot describe.

    Example:
        >>> posterior = shm.update(test, hanger, model="beam2", seed=1)
        >>> posterior.tension_n.mean(), posterior.tension_n.std()
        (711000.0, 4000.0)
    """
    options = UpdateOptions(samples, seed, repeat, method)
    return updating.update(modal_tests(tests), build(model, hanger, priors), options, progress)


def select(
    tests: Tests,
    hanger: Hanger,
    models: Sequence[str] | None = None,
    *,
    seed: int = 1,
    samples: int = 1000,
    repeat: int = 1,
    method: str = METHODS[0],
    priors: str = DESCRIPTION,
    progress: Progress = updating.silent,
) -> Selection:
    """Model classes compared by their evidence, the most probable first.

    The classes are equally probable beforehand, thesis (4.15) to (4.17). Without `models` they are
    those of the setting `models` that apply to this hanger (`shm.models.applicable` says why
    another does not). `Selection.averaged(hanger.limits)` is the tension over all of them. The
    other options are those of `update`. Raises UsageError where one of `models` does not apply,
    BadInput as `update` does.

    Example:
        >>> choice = shm.select(test, hanger, models=["beam1", "beam2"])
        >>> choice.selected.model, choice.probabilities
        ('beam2', (0.98, 0.02))
    """
    usual = () if models else competing_names(hanger, load_settings().model_names)
    classes = [build(name, hanger, priors) for name in models or usual]
    options = UpdateOptions(samples, seed, repeat, method)
    return updating.select(modal_tests(tests), classes, options, progress)
