"""The steps as a researcher calls them in a notebook; `import shm` offers them under their names.

Each has the defaults of the command of its name and gives the value that the step itself gives.
The steps behind them (`shm.identify.identify`, `shm.inference.update`, ...) take options as values
and model classes as objects; these here take names and numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from shm import bridge
from shm.api.arguments import (
    check_hanger,
    check_names,
    check_records,
    check_tests,
)
from shm.api.in_python import in_python
from shm.api.placing import Places, Planes, Units, check_units, with_places
from shm.api.stored import Store
from shm.bridge.hanger import hanger_of
from shm.errors import BadInput, UsageError, check_count
from shm.gap import GapOptions, Progress
from shm.gap import diagnose as diagnosed
from shm.gap.check import CheckOptions
from shm.gap.check import check_gap as checked
from shm.gap.simulator.any_simulator import diagnose_simulator
from shm.identify import Identification, IdentifyOptions
from shm.identify.identification import identify as identified
from shm.inference import UpdateOptions
from shm.inference.answer import updating
from shm.inference.answer.updating import check_class_priors
from shm.inference.calibrating import calibrate
from shm.inference.options import IMPORTANCE, SAMPLERS, silent
from shm.models import DESCRIPTION, build, competing_names
from shm.models.classes.base import Conditions, Model
from shm.read import read as read_file
from shm.read import registry
from shm.settings import Settings, load_settings
from shm.simulate import (
    HammerPlan,
    HangerState,
    PlantedEffect,
    hammer_test,
    spread_places_m,
)
from shm.values import (
    NAN,
    AddedMass,
    Diagnosis,
    FrequencyResponse,
    GapCheck,
    Hanger,
    ModalTest,
    Posterior,
    Recording,
    Selection,
)

__all__ = [
    "Store", "check_gap", "diagnose", "diagnose_simulator", "from_sep005", "identify",
    "load_hanger",
    "load_modes", "read", "round_bar", "select", "simulate", "update",
]  # fmt: skip


def read(
    path: str | Path, *, planes: Planes = None, places_m: Places = None, units: Units = None
) -> Recording | FrequencyResponse:
    """Return the content of one file, in SI units, gaps as NaN.

    CSV, UFF58, HDF5, MATLAB, TDMS, miniSEED or npz; a sidecar NAME.toml beside NAME.csv says what
    the file does not. So do `planes` (`transverse`, `longitudinal`) and `places_m`, in m from the
    deck end: by the names of channels, or one for all accelerations; and `units` by the names of
    channels, as `{"force": "kN", "acc_1": "g"}`. They override file and sidecar.
    Time histories are a Recording, frequency responses a FrequencyResponse. Raises BadInput naming
    file, line, channel and remedy, and UsageError for a channel that the file does not have. A
    .zip holds several files of one test: `shm.read.read_test` gives them all.

    Example:
        >>> recording = shm.read("hanger3.csv", places_m={"acc_1": 2.5, "acc_2": 4.4})
        >>> [channel.name for channel in recording.channels]
        ['force', 'acc_1', 'acc_2']
    """
    with in_python():
        check_units(units)
        return with_places(read_file(Path(path), units), planes, places_m)


def from_sep005(
    channels: Sequence[Mapping[str, Any]] | Mapping[str, Any], *, hanger: int | None = None
) -> Recording:
    """Return the recording of channels in SDyPy's form (SEP005), as the field's readers give them.

    Channels in units of force or acceleration are taken; `Recording.to_sep005` gives them back.
    Raises BadInput naming the channel.

    Example:
        >>> acceleration = {"data": [0.0, 0.1] * 50, "name": "acc", "unit_str": "g", "fs": 100.0}
        >>> shm.from_sep005([acceleration], hanger=3).samples
        100
    """
    return registry.from_sep005(channels, hanger=hanger)


def load_modes(path: str | Path) -> tuple[ModalTest, ...]:
    """Return the modal tests of a `*.modes.json` document, as `shm identify --out` writes it.

    One test each, modes in Hz by plane and order. A sidecar NAME.modes.toml may say hanger, time
    and temperature. Raises BadInput naming test, mode and remedy.

    Example:
        >>> tests = shm.load_modes("hanger3.modes.json")
        >>> tests[0].modes[0].frequency_hz
        5.82
    """
    return registry.load_modes(Path(path))


Test: TypeAlias = ModalTest | Identification
Tests: TypeAlias = Test | Sequence[Test]
"""What `update`, `select` and `diagnose` take."""


def modal_tests(tests: Tests, name: str = "tests") -> tuple[ModalTest, ...]:
    """Return the modal tests, one or many; raises UsageError for anything else."""
    given: tuple[Any, ...] = (tests,)
    if isinstance(tests, Iterable) and not isinstance(tests, str):
        given = tuple(tests)
    check_tests(name, given)
    return tuple(each.test if isinstance(each, Identification) else each for each in given)


def load_hanger(path: str | Path, hanger_id: int | None = None) -> Hanger:
    """Return a hanger from a TOML file: a `bridge.toml`, or a file with one `[[hanger]]` table.

    `hanger_id` says which, and may be left out where the file has one only. Raises BadInput naming
    the table and key at fault, or the hangers that there are.

    Example:
        >>> hanger = shm.load_hanger("bridge.toml", 3)
        >>> hanger.length_m
        12.0
    """
    with in_python():
        return bridge.load_hanger(Path(path), hanger_id)


def round_bar(
    id: int,
    *,
    diameter_m: float,
    length_m: float,
    elastic_modulus_pa: float,
    density_kg_m3: float,
    nominal_tension_n: float,
    name: str = "",
) -> Hanger:
    """Return a round bar, clamped at both ends: section and mass follow from diameter and density.

    The same checks are made as of a `[[hanger]]` table, which can say more (end plates,
    turnbuckles, strands, supports). A nominal tension of 0 is a bar without any. Raises BadInput
    naming the figure that cannot be.

    Example:
        >>> hanger = shm.round_bar(
        ...     3, diameter_m=0.130, length_m=12.0, elastic_modulus_pa=200e9,
        ...     density_kg_m3=7800, nominal_tension_n=711e3,
        ... )
        >>> round(hanger.mass_per_length_kg_m, 1)
        103.5
    """
    values = {
        "id": id,
        "diameter_m": diameter_m,
        "length_m": length_m,
        "elastic_modulus_pa": elastic_modulus_pa,
        "density_kg_m3": density_kg_m3,
        "nominal_tension_n": nominal_tension_n,
        "name": name,
    }
    return hanger_of(values, Path())


Record: TypeAlias = Recording | FrequencyResponse
_DEFAULT = Settings()


def identify(
    records: Record | Sequence[Record],
    *,
    hanger: Hanger | None = None,
    test_id: str | None = None,
    band_hz: tuple[float, float] = (_DEFAULT.band_low_hz, _DEFAULT.band_high_hz),
    identifier: str = _DEFAULT.identifier,
    cross_check: str = _DEFAULT.cross_check,
    estimator: Literal["h1", "h2", "hv"] = "h1",
    reference_force_n: float = _DEFAULT.reference_force_n,
    frequency_allowance: float = _DEFAULT.frequency_allowance,
    mains_hz: float = _DEFAULT.mains_hz,
    window_time_constant_s: float = math.inf,
) -> Identification:
    """Return the modes of one test, each with its standard deviations, and how they were found.

    `records` are those of one test: hits, set-ups, or frequency responses. The description of the
    `hanger`, where known, helps to number the modes. `test_id` names the test; left out, the name
    of its first file. Modes are looked for within `band_hz`. `identifier` and `cross_check` are
    names of `shm.identify.IDENTIFIERS` (`ssi`, `pyoma2`; the latter also `none` and `auto`).
    `estimator` of the frequency response allows for noise in the responses (`h1`), the force
    (`h2`) or both (`hv`). A hit of `reference_force_n` has amplitude 1. `frequency_allowance` is
    the part of a frequency by which it differs from test to test unseen. `window_time_constant_s`
    is that of an exponential window already in given frequency responses.

    `Identification.test` holds the modes; beside it stand quality, hits, the frequency response and
    what was dropped and why. Raises BadInput where the records cannot be used together or are of
    another hanger, NotIdentifiable where no mode can be trusted, UsageError for an unknown name.

    Example:
        >>> test = shm.identify(shm.read("hanger3.csv"), hanger=hanger)
        >>> [(mode.plane, mode.order, mode.frequency_hz) for mode in test.test.modes[:2]]
        [('transverse', 1, 5.83), ('transverse', 2, 14.17)]
    """
    with in_python():
        given: list[Any] = [records]
        if isinstance(records, Iterable) and not isinstance(records, str):
            given = list(records)
        check_records(given)
        if hanger is not None:
            check_hanger(hanger)
        options = IdentifyOptions(
            band_low_hz=band_hz[0],
            band_high_hz=band_hz[1],
            identifier=identifier,
            cross_check=cross_check,
            estimator=estimator,
            reference_force_n=reference_force_n,
            frequency_allowance=frequency_allowance,
            mains_hz=mains_hz,
            window_time_constant_s=window_time_constant_s,
        )
        name = test_id or Path(given[0].source).stem
        found = identified(given, options, test_id=name, hanger=hanger)
        return found if hanger is None else _of(found, hanger, given[0].source)


def _of(found: Identification, hanger: Hanger, source: str) -> Identification:
    """Return the test as one of `hanger`, where its records do not say that it is of another."""
    named = found.test.hanger
    if named not in (None, hanger.id):
        raise BadInput(
            f"the file says hanger {named}, the description is of hanger {hanger.id}.",
            file=source,
            remedy="Give the description of its hanger, or correct the file.",
        )
    return replace(found, test=replace(found.test, hanger=hanger.id))


def update(
    tests: Tests,
    hanger: Hanger,
    model: str = "beam2",
    *,
    seed: int = 1,
    samples: int = 1000,
    priors: str = DESCRIPTION,
    progress: Progress = silent,
    sampler: str = IMPORTANCE,
    calibrated_by: Tests = (),
) -> Posterior:
    """Return the posterior of tension and ends of one model class, given all modes of `tests`.

    `model` is a name of `shm.models.MODELS` (`beam1`, `beam2`, `beam3`, `s1`, `s2`, `solid0`,
    `solid1`, `solid2`), or a baseline with an adopted effect (`beam1+point_mass@everywhere`).
    `priors` say what is possible before the test: by the hanger's `description` (tension from slack
    to 5 times nominal, ends from pinned to clamped, the tolerances of its `scatter`), or by the
    `thesis`: its ranges, an exact description and f_hat ~ N(f(theta), (sigma f_hat)^2 + sd^2),
    thesis (4.5), with the unknown fractional model error sigma and the identification's standard
    deviation sd. `sampler` is `importance`, or `emcee`, which is slower and an independent check.
    `calibrated_by` are tests with a measured tension (`tension_read_n`) of this hanger or of one of
    its family. `progress` hears a label and the fraction done.

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
    with in_python():
        check_hanger(hanger)
        chosen = build(model, hanger, priors)
        options = _options(samples, seed, sampler, calibrated_by, [chosen], progress)
        return updating.update(modal_tests(tests), chosen, options, progress)


def _options(
    samples: int,
    seed: int,
    sampler: str,
    calibrated_by: Tests,
    models: Sequence[Model],
    progress: Progress,
) -> UpdateOptions:
    """Return the options of an update with what `calibrated_by` teaches."""
    if sampler not in SAMPLERS:
        raise UsageError(
            f"there is no sampler {sampler!r}.", remedy=f"Name one of {', '.join(SAMPLERS)}."
        )
    check_count("samples", samples, UpdateOptions.samples)
    check_count("seed", seed, UpdateOptions.seed, least=0)
    options = UpdateOptions(samples, seed, sampler=sampler)
    return calibrate(options, modal_tests(calibrated_by, "calibrated_by"), models, progress)


def select(
    tests: Tests,
    hanger: Hanger,
    models: Sequence[str] | None = None,
    *,
    seed: int = 1,
    samples: int = 1000,
    priors: str = DESCRIPTION,
    progress: Progress = silent,
    sampler: str = IMPORTANCE,
    calibrated_by: Tests = (),
    class_priors: Mapping[str, float] | None = None,
) -> Selection:
    """Compare model classes by their evidence, the most probable first.

    The classes are equally probable beforehand, thesis (4.15) to (4.17), but for clamped ones
    beside one with springs unless the `priors` are the thesis's; `class_priors` say otherwise, such
    as `{"beam1": 0.25, "beam2": 0.75}`. Without `models` they are
    those of the setting `models` that apply to this hanger (`shm.models.applicable` says why
    another does not). `Selection.averaged` is the tension over all of them; with the probabilities
    of one beyond limits it is `Selection.averaged_with(hanger.limits)`. The other options are those
    of `update`. Raises UsageError where one of `models` does not apply,
    BadInput as `update` does.

    Example:
        >>> choice = shm.select(test, hanger, models=["beam1", "beam2"])
        >>> choice.selected.model, choice.probabilities
        ('beam2', (0.98, 0.02))
    """
    with in_python():
        check_hanger(hanger)
        check_names("models", models, "beam2")
        usual = () if models else competing_names(hanger, load_settings().model_names)
        classes = [build(name, hanger, priors) for name in models or usual]
        if class_priors is not None:
            check_class_priors(class_priors, [each.name for each in classes])
        options = _options(samples, seed, sampler, calibrated_by, classes, progress)
        return updating.select(modal_tests(tests), classes, options, progress, class_priors)


_OF_GAP = GapOptions()


def diagnose(
    tests: Tests,
    hanger: Hanger,
    baseline: str = _OF_GAP.baseline,
    *,
    without: Sequence[str] = _OF_GAP.without,
    hold_out: Sequence[str] = _OF_GAP.hold_out,
    draws: int = _OF_GAP.draws,
    seed: int = _OF_GAP.seed,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose where baseline and tests differ, which effect causes it, and what it changes.

    `baseline` is the model class whose gap is diagnosed, empty for the beam that these data prefer;
    `Diagnosis.baseline` names it. `without` are effects taken out of the catalogue; `hold_out` what
    is left out of the fit and predicted: ids of tests or orders of modes (empty: every one in
    turn). `draws` are kept of each posterior. `progress` hears a label and the fraction done.

    The probabilities of `Diagnosis.causes`, of no gap and of something unknown add to 1;
    `Diagnosis.verdict` is what it claims, `Diagnosis.leading` the most probable cause, None where
    none leads; tensions are in N, residuals in percent of a frequency. Raises BadInput where the
    tests cannot be used, UsageError for a model class, effect, test or order that is not there.

    Example:
        >>> diagnosis = shm.diagnose(tests, hanger)
        >>> diagnosis.leading.effect
        'point_mass'
    """
    with in_python():
        check_hanger(hanger)
        check_names("without", without, "point_mass")
        check_names("hold_out", hold_out, "t1")
        check_count("draws", draws, _OF_GAP.draws)
        check_count("seed", seed, _OF_GAP.seed, least=0)
        options = GapOptions(baseline, tuple(without), tuple(hold_out), draws, seed)
        return diagnosed(modal_tests(tests), hanger, options, progress)


def check_gap(
    tests: Tests,
    hanger: Hanger,
    baseline: str = _OF_GAP.baseline,
    *,
    effects: Sequence[str] = (),
    seeds: int = 1,
    sound: int = 5,
    seed: int = 1,
    progress: Progress = silent,
) -> GapCheck:
    """Return which effects `diagnose` would find on a hanger with these tests, and from which size.

    Each of `effects` (all of the catalogue if empty) is planted in a simulated twin of the hanger
    with the modes, sensors, errors and conditions of `tests`, and diagnosed: two or three sizes for
    each of `seeds`, 5 to 30 s each. The twin is the model class `baseline`, empty for the beam that
    these data prefer; without `tests`, `()`, it is the description with a usual hammer test.
    `sound` twins have no effect: `GapCheck.false_gaps` counts gaps that are claimed in them. `shm
    gap check` does the same on all processors. Raises BadInput where the tests cannot be used,
    UsageError for a model class or an effect that is not there.

    Example:
        >>> check = shm.check_gap(tests, hanger, effects=["point_mass"])
        >>> check.effects[0].size, check.effects[0].unit
        (3.5, 'kg')
    """
    with in_python():
        check_hanger(hanger)
        check_names("effects", effects, "point_mass")
        check_count("seeds", seeds, 1)
        check_count("sound", sound, 5, least=0)
        check_count("seed", seed, 1, least=0)
        options = CheckOptions(tuple(effects), baseline, seeds, sound, seed=seed)
        return checked(modal_tests(tests), hanger, options, progress)


def simulate(
    hanger: Hanger,
    *,
    tension_n: float | None = None,
    k1_n_m_rad: float = math.inf,
    k2_n_m_rad: float = math.inf,
    k3_n_m_rad: float = math.inf,
    k4_n_m_rad: float = math.inf,
    damping_ratio: float = 0.001,
    hits: int = 5,
    seconds_per_hit: float = 20.0,
    sampling_rate_hz: float = 512.0,
    sensors: int = 2,
    hammer_x_m: float = NAN,
    acceleration_noise_m_s2: float = 0.02,
    effects: Sequence[PlantedEffect] = (),
    amplitude: float = 1.0,
    temperature_c: float = NAN,
    reference_c: float = 10.0,
    added_mass: AddedMass | None = None,
    time: datetime | None = None,
    seed: int = 1,
) -> Recording:
    """Return the recording of a hammer test of a hanger whose truth you choose.

    The modes are those of the general model of a hanger, `shm.models.hanger`. Left out, `tension_n`
    is the nominal one, the end springs (k1, k3 transverse at deck and arch end; k2, k4
    longitudinal) are clamped, and the hammer hits at 0.16 of the length. Each of 1 to 8 `sensors`
    is biaxial, two channels in m/s^2. Effects of the gap diagnosis are planted as
    `PlantedEffect(name, at, values)`. The level of the hits is `amplitude`; the tension is the
    planted one at `reference_c`. The same seed gives the same recording, that of
    `shm simulate --seed`.

    `Recording.channels` are `force`, then `acc_1`, `acc_2`, ..., each (hits x seconds x rate,).
    Raises UsageError for what cannot be, and for a hanger that is not clamped and in tension.
    `shm.simulate.ambient_test` makes ambient records.

    Example:
        >>> recording = shm.simulate(hanger, tension_n=650e3, k1_n_m_rad=1e7, seed=1)
        >>> len(recording.channels), recording.duration_s
        (5, 100.0)
    """
    check_hanger(hanger)
    check_count("seed", seed, 1, least=0)
    if not hanger.as_hanger:
        raise UsageError(
            f"hanger {hanger.id} is not clamped at both ends, or carries no tension: it cannot be "
            "simulated.",
            remedy="Describe it clamped and in tension; soft ends are k1_n_m_rad to k4_n_m_rad.",
        )
    plan = HammerPlan(
        hits=hits,
        seconds_per_hit=seconds_per_hit,
        sampling_rate_hz=sampling_rate_hz,
        sensors_x_m=spread_places_m(hanger, sensors),
        hammer_x_m=hammer_x_m,
        acceleration_noise_m_s2=acceleration_noise_m_s2,
    )
    shift_k = 0.0 if math.isnan(temperature_c) else temperature_c - reference_c
    recording = hammer_test(
        hanger,
        HangerState(
            hanger.nominal_tension_n if tension_n is None else tension_n,
            k1_n_m_rad, k2_n_m_rad, k3_n_m_rad, k4_n_m_rad,
            damping_ratio=damping_ratio,
        ),
        replace(plan, peak_force_n=plan.peak_force_n * amplitude),
        np.random.default_rng([seed, 0]),
        time=time,
        temperature_c=temperature_c,
        effects=effects,
        conditions=Conditions("", shift_k, amplitude, added_mass),
    )  # fmt: skip
    return replace(recording, added_mass=added_mass)
