"""The steps of the flow: functions of plain values that run wherever the executor puts them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from shm.bridge import Bridge
from shm.errors import BadInput
from shm.identify import IdentifyOptions, identify
from shm.identify.plausibility import signal_doubts
from shm.inference import UpdateOptions, refresh, select, update
from shm.inference.calibrating import learn
from shm.inference.options import Calibration
from shm.models import build
from shm.pipeline.lineage import Taught, Terms, competing, identify_settings, read_limits
from shm.pipeline.remote_file import Opens, WatchResult
from shm.plausibility import fingerprint_of
from shm.read.sandbox import Limits, load_modes, read_test
from shm.settings import Settings
from shm.store import Baseline, IdentifiedTest, StoredRecording
from shm.store.archive import MODES_SUFFIX, refuse_oversize
from shm.values import (
    Beside,
    Hanger,
    ModalTest,
    Posterior,
    Recording,
    Selection,
)
from shm.watch import DatedTest, WatchOptions, joined, watch_gap, watch_newest
from shm.watch.baseline_check import check_baseline
from shm.watch.frequency_watch import measured_levels, watch_newest_frequencies


def options_of(terms: Terms, hanger: Hanger) -> UpdateOptions:
    """The terms of an update as its options."""
    learnt = calibration(terms.taught, hanger)
    return UpdateOptions(samples=terms.samples, seed=terms.seed, calibration=learnt)


def calibration(taught: Taught | None, hanger: Hanger) -> Calibration | None:
    """Return what a measured tension has taught of `hanger`.

    None where there is nothing to learn from.
    """
    return None if taught is None else learn(taught.posterior, hanger, taught.same_hanger)


def identify_file(
    recording: StoredRecording,
    archive: Opens,
    bridge: Bridge,
    settings: Settings,
    selected: Mapping[int, str],
) -> tuple[IdentifiedTest, ...]:
    """The modal tests in a received file; raises BadInput where it cannot be used.

    `selected` names the model class of each hanger that has one: it must be able to describe the
    test, and so must every competing class where none is selected yet.
    """
    _refuse_size(recording.file.size_bytes, settings.max_file_bytes)
    with archive.opened(recording.file) as path:
        if path.name.lower().endswith(MODES_SUFFIX):
            found = _tests_in(path, read_limits(settings))
        else:
            found = (_test_in(path, bridge, settings),)
    for item in found:
        hanger = _hanger(item.test.hanger, bridge)
        if not hanger.is_modelled:
            continue
        for model in competing(hanger, settings, selected):
            model.refuse(item.test)
    return found


def _refuse_size(size_bytes: int, limit_bytes: int) -> None:
    if size_bytes == 0:
        raise BadInput("the file is empty.", remedy="Check the logger and send the file again.")
    refuse_oversize(size_bytes, limit_bytes)


def _tests_in(path: Path, limits: Limits) -> tuple[IdentifiedTest, ...]:
    tests = load_modes(path, limits)
    for name, times in Counter(test.id for test in tests).items():
        if times > 1:
            raise BadInput(f"test id {name} is given {times} times.", remedy="Give each its own.")
    return tuple(IdentifiedTest(test, position) for position, test in enumerate(tests))


def _test_in(path: Path, bridge: Bridge, settings: Settings) -> IdentifiedTest:
    records = read_test(path, read_limits(settings))
    hanger = _hanger(records[0].hanger, bridge)
    options = identify_options(settings, bridge)
    result = identify(records, options, test_id=path.stem, hanger=hanger)
    result = result.with_orders(records[0].source)
    dropped = tuple(f"{each.count} {each.what}: {each.reason}" for each in result.dropped)
    measured = [each for each in records if isinstance(each, Recording)]
    return IdentifiedTest(
        result.test,
        frequency_response=result.frequency_response,
        notes=(*result.notes, *dropped),
        quality=result.quality,
        set_aside=result.set_aside,
        times=tuple(record.time for record in records if record.time is not None),
        fingerprint=fingerprint_of(records),
        signals=tuple(each.text for each in signal_doubts(measured, hanger))
        if hanger.is_modelled
        else (),
        possible_times=_possible_times(result.test, measured),
    )


def _possible_times(test: ModalTest, records: Sequence[Recording]) -> tuple[datetime, ...]:
    """Return the times of a test whose day can be read in several orders; empty for others."""
    if test.time is not None:
        return ()
    return next((each.possible_times for each in records if each.possible_times), ())


def identify_options(settings: Settings, bridge: Bridge) -> IdentifyOptions:
    """Return how recordings of a bridge are identified."""
    bands = tuple((each.name, each.low_hz, each.high_hz) for each in bridge.disturbances)
    return IdentifyOptions(**identify_settings(settings), disturbance_bands=bands)


def _hanger(hanger_id: int | None, bridge: Bridge) -> Hanger:
    if hanger_id is None:
        raise BadInput(
            "the file names no hanger.",
            remedy="Give `hanger` in its header or its sidecar, or say it once for all files of"
            " this logger: `shm import FILE`.",
        )
    return bridge.tested(hanger_id)


def select_model(
    tests: Sequence[ModalTest], hanger: Hanger, names: Sequence[str], terms: Terms
) -> Selection:
    """The competing classes of a hanger, compared on its first tests, their mistakes left out."""
    if not hanger.is_modelled:
        return Selection((measured_levels(tests, terms.seed),), (1.0,))
    models = [build(name, hanger, terms.priors) for name in names]
    check = check_baseline(tests, hanger)
    found = select(check.accepted_tests(tests), models, options_of(terms, hanger))
    posteriors = tuple(replace(each, baseline_check=check) for each in found.posteriors)
    return replace(found, posteriors=posteriors)


def update_test(
    test: ModalTest, hanger: Hanger, name: str, known: Posterior | None, terms: Terms
) -> Posterior:
    """The posterior of one test in the selected class, from what is `known` where that helps."""
    if not hanger.is_modelled:
        return measured_levels([test], terms.seed)
    model, options = build(name, hanger, terms.priors), options_of(terms, hanger)
    # Where description or priors have changed since, the class may have other parameters by now.
    if known is None or known.names[:-1] != model.parameter_names:
        return update([test], model, options)
    return refresh([test], model, known, options)


def watch_test(
    baseline: Baseline,
    tests: tuple[Sequence[DatedTest], Sequence[DatedTest]],
    current: Posterior,
    hanger: Hanger,
    limit_years: float,
    state: bytes | None = None,
    neighbours: Beside | None = None,
) -> WatchResult | None:
    """Return what the watch says after a test, the alert that it calls for, what to keep of it.

    `tests` are those of the baseline and those since, the last of which is the one in question; or
    that one alone, with the `state` before it: None where nothing can go on from that. The
    `neighbours` of it are those that it may agree with, whatever the clocks say.
    """
    since_baseline, later = tests
    options = WatchOptions.of(hanger.assumptions, limit_years=limit_years)
    try:
        found = (
            watch_newest(
                baseline.posterior, since_baseline, later, hanger, options, state, neighbours
            )
            if hanger.is_modelled
            else watch_newest_frequencies(since_baseline, later, hanger, options, state)
        )
    except BadInput:
        if state is None:
            raise
        found = None  # what was kept may be damaged, and the watch can do without it
    if found is None:
        return None
    test, time = later[-1]
    alert = found.alert
    if hanger.is_modelled:
        gap = watch_gap(baseline.posterior, current, hanger, test=test.id, time=time)
        alert = joined(alert, gap)
    # A new baseline makes a standing condition a new one.
    alert = alert and replace(alert, key=f"{alert.key}:baseline-{baseline.id}")
    return found.test, alert, found.kept
