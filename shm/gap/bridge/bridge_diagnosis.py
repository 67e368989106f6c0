"""The joint diagnosis of several hangers: one cause that they share, or each for itself.

Each hanger is diagnosed for itself; its evidence is then weighed again under shared causes
(`shm.gap.bridge.shared_causes`). So a bridge costs little more than its hangers, and no data are
used twice: a hanger's own priors are taken out before those of the group come in.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.errors import UsageError
from shm.gap.bridge.shared_causes import (
    LEAST,
    SCATTERS,
    OwnCauses,
    SharedEvidence,
    SizeGrid,
    find_groups,
    weigh_shared,
    weigh_unknown,
)
from shm.gap.bridge.shared_evidence import HangerEvidence, Place, Sizes, weigh_hanger
from shm.gap.causes.groups import SAME_BELOW
from shm.gap.causes.places import AS_LIKELY
from shm.gap.causes.probabilities import CALIBRATION, SINGLE, UNKNOWN
from shm.gap.diagnose import examined, summarise, tension_estimate
from shm.gap.hypotheses.contract import GapOptions
from shm.gap.hypotheses.coordinates import scale_free
from shm.inference.options import Progress, silent
from shm.inference.sampler.mixture import normalised, systematic
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

_JOINTLY = 0.9  # numerical: the part of the time that single hangers take
_NEGLIGIBLE = 1e-4  # of a probability: what is less likely changes no number of the diagnosis
_DRAWS = 4000  # numerical: a 95 % interval to 2 % of its width


def diagnose_bridge(
    hangers: Sequence[tuple[Hanger, Sequence[ModalTest]]],
    options: GapOptions | None = None,
    progress: Progress = silent,
) -> BridgeDiagnosis:
    """Return whether several hangers, each with its tests, share a cause; which, and who has it.

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
    evidence = []
    for index, (hanger, tests) in enumerate(hangers):

        def report(label: str, done: float, at: int = index, number: int = hanger.id) -> None:
            progress(f"hanger {number}: {label}", _JOINTLY * (at + done) / len(hangers))

        evidence.append(examine_hanger(tests, hanger, options, report))
    progress("what they share", _JOINTLY)
    found = diagnose_jointly(evidence, options, started)
    progress("what they share", 1.0)
    return found


def examine_hanger(
    tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions, progress: Progress = silent
) -> HangerEvidence:
    """Return the evidence of a hanger that is diagnosed for itself."""
    diagnosis, attribution = examined(tests, hanger, options, progress)
    rng = np.random.default_rng([options.seed, hanger.id])
    return weigh_hanger(hanger, tests, diagnosis, attribution, rng)


def _check(hangers: Sequence[Hanger]) -> None:
    if len(hangers) < LEAST:
        raise UsageError(
            "a shared cause takes two hangers.",
            remedy="Give a second one, or --hanger-file H.toml for one.",
        )
    for number, count in Counter(each.id for each in hangers).items():
        if count > 1:
            raise UsageError(
                f"{count} hangers have the number {number}.",
                remedy="Give each an id of its own in its description.",
            )


@dataclass(frozen=True, eq=False)
class _Candidate:
    """An effect at a place shared by a group; `log_weight` is prior times evidence."""

    place: Place
    grid: SizeGrid
    shared: SharedEvidence
    log_weight: float


def diagnose_jointly(
    hangers: Sequence[HangerEvidence], options: GapOptions, started: float | None = None
) -> BridgeDiagnosis:
    """Return the causes that hangers share, by the evidence of each."""
    started = time.perf_counter() if started is None else started
    groups, individual = find_groups(hangers), OwnCauses.of(hangers)
    places = dict.fromkeys(place for each in hangers for place in each.effects)
    variants = Counter(name for name, _ in places)
    of_effect = np.log(SHARED * _KNOWN / max(len(variants), 1))
    candidates = [
        _Candidate(place, grid, shared, shared.log_evidence + float(log_prior))
        for place in places
        if (grid := SizeGrid.of(hangers, place)) is not None
        for log_prior in [of_effect - np.log(variants[place[0]] * len(groups))]
        for shared in [weigh_shared(grid, group, individual) for group in groups]
    ]
    log_unknown = np.log(SHARED * (1 - _KNOWN) / len(groups))
    unknown = [weigh_unknown(hangers, group, individual) + log_unknown for group in groups]
    unknown += [each.log_weight + _log_mimic_odds(hangers, each) for each in candidates]
    known = [each.log_weight for each in candidates]
    total = float(scipy.special.logsumexp([np.log(1 - SHARED), *unknown, *known]))
    by_effect: dict[str, list[_Candidate]] = {}
    for each in sorted(candidates, key=lambda each: -each.log_weight):
        by_effect.setdefault(each.place[0], []).append(each)
    causes = [_cause(hangers, every, total, float(of_effect)) for every in by_effect.values()]
    causes, inseparable = _grouped(sorted(causes, key=lambda each: -each.probability))
    return BridgeDiagnosis(
        baseline=", ".join(dict.fromkeys(each.diagnosis.baseline for each in hangers)),
        hangers=tuple(each.hanger.id for each in hangers),
        each_for_itself_probability=float(np.exp(np.log(1 - SHARED) - total)),
        unknown_probability=float(np.exp(scipy.special.logsumexp(unknown) - total)),
        causes=tuple(causes),
        groups=inseparable,
        tensions=_tensions(hangers, candidates, total, np.random.default_rng(options.seed)),
        diagnoses=tuple(each.diagnosis for each in hangers),
        left_out=options.without,
        seed=options.seed,
        seconds=time.perf_counter() - started,
    )


def _log_mimic_odds(hangers: Sequence[HangerEvidence], candidate: _Candidate) -> float:
    """Return log odds of something unknown that passes for the effect in all that have it.

    Its law may be off in every hanger, which adds up; that it fits in each to the letter says no
    more than in one, since what imitates one imitates all.
    """
    shared = candidate.shared
    odds = sum(
        member * effect.log_mimic_odds
        for index, member in zip(shared.group.members, shared.member.tolist(), strict=True)
        if (effect := hangers[index].effects.get(candidate.place)) is not None
    )
    one = odds / max(float(shared.member.sum()), 1.0)
    return float(max(odds, one) + np.log(CALIBRATION.mimics_one * UNKNOWN / SINGLE))


def _cause(
    hangers: Sequence[HangerEvidence],
    candidates: Sequence[_Candidate],
    total: float,
    log_prior: float,
) -> SharedCause:
    """Return an effect by its candidates, of all places and groups, the best first."""
    best, log = candidates[0], np.array([each.log_weight for each in candidates])
    probability = np.zeros(len(hangers))
    for each, share in zip(candidates, normalised(log), strict=True):
        probability[list(each.shared.group.members)] += share * each.shared.member
    log_weight = float(scipy.special.logsumexp(log))
    near = [each.place[1] for each in candidates if each.log_weight > best.log_weight - AS_LIKELY]
    sizes = next(e.effects[best.place].sizes for e in hangers if best.place in e.effects)
    of_group = best.shared.size.sum(axis=1)
    size = _estimate(sizes, best.grid.x, best.grid.sign, of_group)
    scatter = float(best.shared.size.sum(axis=0) @ SCATTERS)
    family = best.shared.group.members
    return SharedCause(
        effect=best.place[0],
        at=best.place[1],
        probability=float(np.exp(log_weight - total)),
        log_bayes_factor=log_weight - log_prior,
        likeness=best.shared.group.likeness,
        family=tuple(hangers[index].hanger.id for index in family),
        members=tuple(
            SharedMember(
                hangers[index].hanger.id,
                float(probability[index]),
                _member_size(hangers[index], best, index) or size,
            )
            for index in family
        ),
        size=size,
        scatter=10**scatter - 1 if scale_free(sizes.parameter) else scatter,
        also_at=tuple(each for each in dict.fromkeys(near) if each != best.place[1]),
    )


def _member_size(hanger: HangerEvidence, best: _Candidate, index: int) -> EffectEstimate | None:
    """Return the size in one hanger, seen with the others; None where it shows nothing itself."""
    effect = hanger.effects.get(best.place)
    if effect is None:
        return None
    weight = best.shared.point_weights(best.grid, effect, index)
    return _estimate(effect.sizes, effect.x, effect.sign, weight) if weight.any() else None


def _estimate(sizes: Sizes, x: FloatArray, sign: FloatArray, weight: FloatArray) -> EffectEstimate:
    rows = systematic(weight / weight.sum(), _DRAWS, np.random.default_rng(0))
    value = sizes.value(x[rows]) * sign[rows]
    return EffectEstimate(sizes.parameter.name, sizes.parameter.unit, *summarise(value))


def _grouped(
    causes: Sequence[SharedCause],
) -> tuple[list[SharedCause], tuple[tuple[str, ...], ...]]:
    """Return the causes, those that the data hardly prefer the best to in one group with it."""
    best = max((each.log_bayes_factor for each in causes), default=0.0)
    equivalent = [each.effect for each in causes if each.log_bayes_factor > best - SAME_BELOW]
    if len(equivalent) < LEAST or best < SAME_BELOW:
        return list(causes), ()
    found = [replace(each, group=0) if each.effect in equivalent else each for each in causes]
    return found, (tuple(equivalent),)


def _tensions(
    hangers: Sequence[HangerEvidence],
    candidates: Sequence[_Candidate],
    total: float,
    rng: np.random.Generator,
) -> tuple[HangerTensions, ...]:
    """Return the tensions over all candidates, and over each hanger alone for the rest."""
    likely = [each for each in candidates if each.log_weight - total > np.log(_NEGLIGIBLE)]
    found = []
    for index, each in enumerate(hangers):
        draws, weights = [each.tension_n], [np.empty(0)]
        for cause in likely:
            effect = each.effects.get(cause.place)
            if effect is not None and index in cause.shared.group.members:
                draws.append(effect.tension_n)
                points = cause.shared.point_weights(cause.grid, effect, index)
                weights.append(np.exp(cause.log_weight - total) * points)
        alone = max(0.0, 1 - sum(float(weight.sum()) for weight in weights))
        weights[0] = np.full(len(each.tension_n), alone / len(each.tension_n))
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
