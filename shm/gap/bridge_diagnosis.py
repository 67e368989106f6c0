"""The joint diagnosis of several hangers: one cause that they share, or each for itself.

Each hanger is diagnosed for itself; what that says is then weighed again under causes in common
(`shm.gap.shared_causes`). So a bridge costs little more than its hangers, and no data are used
twice: a hanger's own priors are taken out before the family's come in.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.errors import UsageError
from shm.gap.attribution import SAME_BELOW
from shm.gap.contract import GapOptions
from shm.gap.coordinates import scale_free
from shm.gap.diagnose import examined, tension_estimate
from shm.gap.model_probabilities import CALIBRATION, SINGLE, UNKNOWN
from shm.gap.shared_causes import LEAST, SCATTERS, Own, Shared, Sizes, kin, shared, sizes, unknown
from shm.gap.shared_evidence import Patient, Place, Reach, patient
from shm.inference.mixture import systematic
from shm.inference.options import Progress, silent
from shm.values import (
    BridgeDiagnosis,
    EffectEstimate,
    FloatArray,
    Hanger,
    HangerTensions,
    ModalTest,
    SharedCause,
    SharedMember,
)

# Before any data, judgement: who asks for a bridge as a whole suspects a common cause as often as
# not; of these as many are unknown as in single hangers.
SHARED = 0.5
_KNOWN = SINGLE / (SINGLE + UNKNOWN)

_JOINTLY = 0.9  # technical: the part of the time that single hangers take
_AS_LIKELY = 1.5
"""Places of one effect whose log evidences differ by less are not told apart."""
_FAINT = 1e-4  # of a probability: what is less likely changes no number that is told
_TINY = 1e-300  # technical: a sum that is none
_DRAWS = 4000  # technical: a 95 % interval to 2 % of its width


def diagnose_bridge(
    hangers: Sequence[tuple[Hanger, Sequence[ModalTest]]],
    options: GapOptions | None = None,
    progress: Progress = silent,
) -> BridgeDiagnosis:
    """Whether several hangers, each with its tests, share a cause; which, who has it, what then.

    The same tests, options and seed give the same answer. Raises UsageError for fewer than two
    hangers or two of one number, and whatever `diagnose` raises of a single one.

    Example:
        >>> found = diagnose_bridge([(hanger3, tests3), (hanger4, tests4)])
        >>> found.leading.named
        (3, 4)
    """
    options = options or GapOptions()
    started = time.perf_counter()
    _check([hanger for hanger, _ in hangers])
    patients = []
    for index, (hanger, tests) in enumerate(hangers):

        def tell(label: str, done: float, at: int = index, of: int = hanger.id) -> None:
            progress(f"hanger {of}: {label}", _JOINTLY * (at + done) / len(hangers))

        patients.append(examined_patient(tests, hanger, options, tell))
    progress("what they share", _JOINTLY)
    found = jointly(patients, options, started)
    progress("what they share", 1.0)
    return found


def examined_patient(
    tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions, progress: Progress = silent
) -> Patient:
    """A hanger diagnosed for itself."""
    diagnosis, attribution = examined(tests, hanger, options, progress)
    rng = np.random.default_rng([options.seed, hanger.id])
    return patient(hanger, tests, diagnosis, attribution, rng)


def _check(hangers: Sequence[Hanger]) -> None:
    if len(hangers) < LEAST:
        raise UsageError("a shared cause takes two hangers.", remedy="Give a second one.")
    for number, count in Counter(each.id for each in hangers).items():
        if count > 1:
            raise UsageError(
                f"{count} hangers have the number {number}.",
                remedy="Give each an id of its own in its description.",
            )


@dataclass(frozen=True, eq=False)
class _Weighed:
    """An effect at a place shared by a family; `log_weight` is prior times evidence."""

    place: Place
    found: Sizes
    shared: Shared
    log_weight: float


def jointly(
    patients: Sequence[Patient], options: GapOptions, started: float | None = None
) -> BridgeDiagnosis:
    """What hangers share, by what each says for itself."""
    started = time.perf_counter() if started is None else started
    tried, families = _tried(patients), kin(patients)
    nameless = [unknown(patients, each, Own.of(patients)).log_evidence for each in families]
    unknowns = float(scipy.special.logsumexp(nameless)) + np.log(
        SHARED * (1 - _KNOWN) / len(families)
    )
    mimics = [each.log_weight + _log_mimic_odds(patients, each) for each in tried]
    whole = float(scipy.special.logsumexp([np.log(1 - SHARED), unknowns, *mimics, *_logs(tried)]))
    by_effect: dict[str, list[_Weighed]] = {}
    for each in sorted(tried, key=lambda each: -each.log_weight):
        by_effect.setdefault(each.place[0], []).append(each)
    causes = [_cause(patients, every, whole) for every in by_effect.values()]
    causes, groups = _grouped(sorted(causes, key=lambda each: -each.probability))
    return BridgeDiagnosis(
        baseline=options.baseline,
        hangers=tuple(each.hanger.id for each in patients),
        each_for_itself_probability=float(np.exp(np.log(1 - SHARED) - whole)),
        unknown_probability=float(np.exp(scipy.special.logsumexp([unknowns, *mimics]) - whole)),
        causes=tuple(causes),
        groups=groups,
        tensions=_tensions(patients, tried, whole, np.random.default_rng(options.seed)),
        diagnoses=tuple(each.diagnosis for each in patients),
        left_out=options.without,
        seed=options.seed,
        seconds=time.perf_counter() - started,
    )


def _tried(patients: Sequence[Patient]) -> list[_Weighed]:
    """Every effect at every place, shared by every family."""
    own, families = Own.of(patients), kin(patients)
    places = list(dict.fromkeys(place for each in patients for place in each.effects))
    variants = Counter(name for name, _ in places)
    tried = []
    for place in places:
        found = sizes(patients, place)
        if found is None:
            continue
        prior = SHARED * _KNOWN / (len(variants) * variants[place[0]] * len(families))
        for family in families:
            said = shared(found, family, own)
            tried.append(_Weighed(place, found, said, said.log_evidence + float(np.log(prior))))
    return tried


def _logs(tried: Sequence[_Weighed]) -> list[float]:
    return [each.log_weight for each in tried]


def _log_mimic_odds(patients: Sequence[Patient], tried: _Weighed) -> float:
    """Log odds of something unknown that passes for the effect, in all hangers that have it.

    Its law may be off in every one of them, which speaks up with each; that it fits in each to the
    letter says no more than in one, since what imitates one imitates all.
    """
    family, place = tried.shared.kin.members, tried.place
    odds = np.array(
        [
            member * patients[index].effects[place].log_mimic_odds
            for index, member in zip(family, tried.shared.member, strict=True)
            if place in patients[index].effects
        ]
    )
    together = float(odds.sum())
    one = together / max(float(tried.shared.member.sum()), 1.0)
    return max(together, one) + float(np.log(CALIBRATION.mimics_one * UNKNOWN / SINGLE))


def _cause(patients: Sequence[Patient], tried: Sequence[_Weighed], whole: float) -> SharedCause:
    """An effect, by what was tried of it: wherever it acts and whoever shares it, best first."""
    best, log = tried[0], np.array(_logs(tried))
    share = np.exp(log - scipy.special.logsumexp(log))
    chance = np.zeros(len(patients))
    for each, part in zip(tried, share, strict=True):
        chance[list(each.shared.kin.members)] += part * each.shared.member
    family = best.shared.kin.members
    prior = SHARED * _KNOWN / len({name for each in patients for name, _ in each.effects})
    also = [
        each.place[1]
        for each in tried
        if each.place != best.place and each.log_weight > best.log_weight - _AS_LIKELY
    ]
    reach = next(p.effects[best.place].reach for p in patients if best.place in p.effects)
    return SharedCause(
        effect=best.place[0],
        at=best.place[1],
        probability=float(np.exp(scipy.special.logsumexp(log) - whole)),
        log_bayes_factor=float(scipy.special.logsumexp(log) - np.log(prior)),
        likeness=best.shared.kin.likeness,
        family=tuple(patients[index].hanger.id for index in family),
        members=tuple(
            SharedMember(
                patients[index].hanger.id,
                float(chance[index]),
                _size(patients[index], best, row, index, reach),
            )
            for row, index in enumerate(family)
        ),
        size=_common_size(reach, best),
        scatter=_scatter(best, reach),
        also_at=tuple(dict.fromkeys(also)),
    )


def _size(one: Patient, best: _Weighed, row: int, index: int, common: Reach) -> EffectEstimate:
    """Of one hanger, seen with the others; what the family has, where it shows nothing itself."""
    evidence = one.effects.get(best.place)
    if evidence is None:
        return _common_size(common, best)
    weight = np.concatenate(
        [
            best.found.draw_weights(best.found.at[index], best.shared.weight[row]),
            best.found.draw_weights(best.found.faint_at[index], best.shared.faint[row]),
        ]
    )
    if weight.sum() < _TINY:
        return _common_size(common, best)
    x, sign = (
        np.concatenate([getattr(each, name) for each in (evidence, evidence.faint)])
        for name in ("x", "sign")
    )
    return _estimate(evidence.reach, x, sign, weight)


def _common_size(reach: Reach, best: _Weighed) -> EffectEstimate:
    weight = best.shared.size.sum(axis=1)
    return _estimate(reach, best.found.x, best.found.sign, weight)


def _estimate(reach: Reach, x: FloatArray, sign: FloatArray, weight: FloatArray) -> EffectEstimate:
    rows = systematic(weight / weight.sum(), _DRAWS, np.random.default_rng(0))
    value = reach.value(x[rows]) * sign[rows]
    low, high = (float(each) for each in np.quantile(value, [0.05, 0.95]))
    return EffectEstimate(
        reach.parameter.name,
        reach.parameter.unit,
        float(value.mean()),
        float(value.std()),
        low,
        high,
    )


def _scatter(best: _Weighed, reach: Reach) -> float:
    """By which fraction the members' sizes differ; of the range where it has no scale."""
    mean = float(best.shared.size.sum(axis=0) @ SCATTERS)
    return 10**mean - 1 if scale_free(reach.parameter) else mean


def _grouped(
    causes: Sequence[SharedCause],
) -> tuple[list[SharedCause], tuple[tuple[str, ...], ...]]:
    """Those that the data hardly prefer the best to are claimed with it."""
    best = max((each.log_bayes_factor for each in causes), default=0.0)
    alike = [each.effect for each in causes if each.log_bayes_factor > best - SAME_BELOW]
    if len(alike) < LEAST or best < SAME_BELOW:
        return list(causes), ()
    found = [replace(each, group=0) if each.effect in alike else each for each in causes]
    return found, (tuple(alike),)


def _tensions(
    patients: Sequence[Patient], tried: Sequence[_Weighed], whole: float, rng: np.random.Generator
) -> tuple[HangerTensions, ...]:
    likely = [
        (each, float(np.exp(each.log_weight - whole)))
        for each in tried
        if each.log_weight - whole > np.log(_FAINT)
    ]
    found = []
    for index, each in enumerate(patients):
        draws, weights = [], []
        for cause, probability in likely:
            if index in cause.shared.kin.members and cause.place in each.effects:
                row, evidence = cause.shared.kin.members.index(index), each.effects[cause.place]
                for points, at, by_size in (
                    (evidence, cause.found.at[index], cause.shared.weight[row]),
                    (evidence.faint, cause.found.faint_at[index], cause.shared.faint[row]),
                ):
                    draws.append(points.tension_n)
                    weights.append(probability * cause.found.draw_weights(at, by_size))
        alone = max(0.0, 1 - sum(float(weight.sum()) for weight in weights))
        draws.append(each.tension_n)
        weights.append(np.full(len(each.tension_n), alone / len(each.tension_n)))
        weight = np.concatenate(weights)
        samples = np.concatenate(draws)[systematic(weight / weight.sum(), _DRAWS, rng)]
        found.append(
            HangerTensions(
                each.hanger.id,
                each.diagnosis.tension_before_n,
                each.diagnosis.tension_after_n,
                tension_estimate(samples),
            )
        )
    return tuple(found)
