"""Find the hangers of a bridge that gained and lost tension together, and the best explanation.

The tension shifts y (n,) of the compared hangers are y = x + e, e ~ N(0, D): each hanger's own
variance and a small part common to all. An explanation is a set of hypotheses x ~ N(0, U U') with a
factor U (n, r) of few columns, so that evidence and posterior have a closed form (Rasmussen and
Williams 2006, appendix A.3). A loss or a gain is the half of such a normal law with that sign. Only
"independent shifts" is another law, summed by quadrature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Literal

import numpy as np
import scipy

from shm.errors import NothingThere
from shm.values import NAN, TENSION, Drift, FloatArray, IntArray
from shm.values.rounding import NINETY_PERCENT

ExplanationName = Literal[
    "no change", "load redistribution", "load gain", "common shift", "independent shifts"
]
Way = Literal["gained", "lost", "unchanged"]

FEWEST = 3  # hangers: of two, either may be the one that moved
REACH = 2  # places: what hangers further off take up is below 5 % of a loss
_SUSPECTS = 3  # technical: so many are listed, and pairs are tried of so many
# Judgement: root mean square of the tests' temperature changes from which temperature can be a
# cause, and their scatter, as a share of it, from which hangers were tested at unlike temperatures.
_SWING_K, _UNLIKE = 5.0, 0.2
# Technical: at a sixteenth of an sd the trapezoid rule is exact to rounding for a normal law, and
# Gauss's of 16 nodes for polynomials of degree 31.
_COMMON = np.linspace(-5, 5, 161)
_CHANCE, _CHANCE_WEIGHT = np.polynomial.legendre.leggauss(16)


# ---------------------------------------------------------------- what goes in


@dataclass(frozen=True)
class HangerShift:
    """The shift of a hanger's tension from its baseline at its latest test, individually.

    `place` counts the hangers along the bridge, those without a test too; two rows of hangers stand
    in one count if three places or more are left free between them. `temperature_change_k` is that
    of the latest test from the baseline's mean, NaN where unknown.
    """

    hanger: int
    place: int
    time: datetime
    baseline_n: float
    shift_n: float
    shift_sd_n: float
    position_m: float = NAN
    temperature_change_k: float = NAN


@dataclass(frozen=True)
class NeighbourOptions:
    """Priors and limits of the pattern over a bridge.

    - `prior`: most looks at a bridge find nothing; a hanger that slackens is what one watches for;
      one that gains was tightened, and somebody would know; faults of a whole campaign and of
      single hangers (a sensor moved, a wrong description) are about as frequent as damage.
    - `sizes_fraction`: a shift, if there is one, is normal with one of these standard deviations,
      fractions of the tension, equally likely: half a decade apart, no size preferred.
    - `nearest_share`, `next_share`: what each neighbour takes up of a lost load on average, as a
      stiff deck spreads it; the shares scatter as a Dirichlet of `share_concentration` does, which
      is a standard deviation of 0.19 and 0.15.
    - `two_hangers`: the prior share of two hangers shedding load at once.
    - `scatter_fraction`: what parked loads and the like add to each hanger's standard deviation.
    - `common_scatter_fraction`: what the temperature correction leaves in all hangers together.
    - `noise_scales`, `noise_prior`: stated standard deviations may be too small by such a factor.
    - `negligible_fraction`: a shift within it counts as unchanged.
    - `named_from`: the probability from which an explanation is named.
    """

    window_days: float = 30.0
    prior: Mapping[ExplanationName, float] = field(
        default_factory=lambda: MappingProxyType(
            {
                "no change": 0.70,
                "load redistribution": 0.10,
                "load gain": 0.04,
                "common shift": 0.08,
                "independent shifts": 0.08,
            }
        )
    )
    sizes_fraction: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3)
    nearest_share: float = 0.35
    next_share: float = 0.15
    share_concentration: float = 5.0
    two_hangers: float = 0.2
    scatter_fraction: float = 0.001
    common_scatter_fraction: float = 0.002
    noise_scales: tuple[float, ...] = (1.0, 1.5, 2.25)
    noise_prior: tuple[float, ...] = (0.7, 0.2, 0.1)
    negligible_fraction: float = 0.005
    named_from: float = 0.8


# ---------------------------------------------------------------- what comes out


@dataclass(frozen=True)
class Explanation:
    """One explanation of all shifts together; the probabilities of a pattern's five add to 1."""

    name: ExplanationName
    probability: float


@dataclass(frozen=True)
class Suspect:
    """The hangers (one or two) that shed or gained load, if any did.

    `probability` is given all the data, all explanations admitted; `shift_n` and `shift_sd_n` hold
    the shift of each if it is they, in which their neighbours have a say.
    """

    name: ExplanationName
    hangers: tuple[int, ...]
    probability: float
    shift_n: tuple[float, ...]
    shift_sd_n: tuple[float, ...]


@dataclass(frozen=True)
class HangerRow:
    """One hanger: its shift as measured, with 90 % interval, and which way it moved.

    `probability` is that of `way`, all explanations weighed; a shift of all hangers alike counts as
    a move too. Fractions are of the baseline tension.
    """

    hanger: int
    place: int
    position_m: float
    time: datetime
    baseline_n: float
    shift_n: float
    low_n: float
    high_n: float
    shift_fraction: float
    low_fraction: float
    high_fraction: float
    way: Way
    probability: float
    gained_probability: float
    lost_probability: float


@dataclass(frozen=True)
class SumKept:
    """The probability that the tensions of `hangers` add to what they did.

    `probability` is that of the explanations which keep the sum. `complete` is false where a hanger
    among them has no shift, or where the bridge's end may have taken a share.
    """

    hangers: tuple[int, ...]
    sum_n: float
    sum_sd_n: float
    probability: float
    complete: bool


@dataclass(frozen=True)
class NotCompared:
    """A hanger that the pattern leaves out, and why; `time` is None where it has no test."""

    hanger: int
    place: int
    time: datetime | None
    why: str


@dataclass(frozen=True)
class BridgePattern:
    """The changes over a bridge: five explanations, the most probable first, and each hanger.

    `suspects` are the likeliest hangers to have shed or gained load. `alike_fraction` and its sd
    are the common shift if all moved alike, and `alike_cause` what that would be put down to.
    `sentence` and `remarks` say it to the owner.
    """

    newest: datetime
    explanations: tuple[Explanation, ...]
    suspects: tuple[Suspect, ...]
    rows: tuple[HangerRow, ...]
    sum_kept: SumKept
    alike_fraction: float
    alike_sd: float
    alike_cause: str
    not_compared: tuple[NotCompared, ...]
    sentence: str
    remarks: tuple[str, ...] = ()

    def probability(self, name: ExplanationName) -> float:
        """Return the probability of one explanation."""
        return next(each.probability for each in self.explanations if each.name == name)


# ---------------------------------------------------------------- which hangers are compared


def shifts_of(
    drifts_by_hanger: Mapping[int, Sequence[Drift]],
    order: Sequence[int],
    *,
    temperature_changes_k: Mapping[int, float] | None = None,
) -> tuple[HangerShift, ...]:
    """The latest known tension shift of each hanger that has one, in their `order` on the bridge.

    `order` names all hangers, those without a test too: a place is an index into it. A drift whose
    numbers are unknown is passed over for the one before it.
    """
    changes, found = temperature_changes_k or {}, []
    for place, hanger in enumerate(order):
        known = [each for each in drifts_by_hanger.get(hanger, ()) if _is_known(each)]
        if known:
            # Of two at one time the later in the list is of the newer baseline.
            latest = max(reversed(known), key=lambda each: each.time)
            n = latest.baseline
            size = latest.shift_mean * n, latest.shift_sd * n
            kelvin = changes.get(hanger, NAN)
            found.append(HangerShift(hanger, place, latest.time, n, *size, NAN, kelvin))
    return tuple(found)


def _is_known(drift: Drift) -> bool:
    numbers = drift.baseline, drift.shift_mean, drift.shift_sd
    usable = all(map(math.isfinite, numbers)) and drift.baseline > 0 < drift.shift_sd
    return drift.quantity == TENSION and usable


def _compared(
    shifts: Sequence[HangerShift], order: Sequence[int], days: float
) -> tuple[list[HangerShift], tuple[NotCompared, ...]]:
    """Return the shifts of the last `days`, by place, and the hangers that are left out."""
    newest = max((each.time for each in shifts), default=datetime.min)
    recent, left_out = [], []
    for each in sorted(shifts, key=lambda each: each.place):
        if each.time >= newest - timedelta(days=days):
            recent.append(each)
        else:
            why = f"its latest test is more than {days:g} days older than the newest"
            left_out.append(NotCompared(each.hanger, each.place, each.time, why))
    tested = {each.hanger for each in shifts}
    why = "no test of it has been compared with a baseline"
    left_out += [NotCompared(h, at, None, why) for at, h in enumerate(order) if h not in tested]
    if len(recent) < FEWEST:
        few = (
            f"{len(shifts)} of the hangers have a shift from a baseline"
            if len(shifts) < FEWEST
            else f"{len(recent)} of the hangers have a test of the last {days:g} days"
        )
        raise NothingThere(
            f"only {few}; a pattern over the bridge needs {FEWEST}.",
            remedy="Test more hangers, in one campaign: the first tests of each form its baseline.",
        )
    return recent, tuple(sorted(left_out, key=lambda each: each.place))


# ---------------------------------------------------------------- hypotheses and their evidence


@dataclass(frozen=True, eq=False)
class Bridge:
    """Shifts, their noise and the tensions they started from, each (n,); `places` (n,) along it."""

    places: IntArray
    shift_n: FloatArray
    sd_n: FloatArray
    baseline_n: FloatArray
    common_sd_n: FloatArray

    @classmethod
    def of(
        cls, shifts: Sequence[HangerShift], options: NeighbourOptions, noise_scale: float = 1.0
    ) -> Bridge:
        """The compared hangers with the scatter that their own standard deviations leave out."""
        rows = [(s.place, s.shift_n, s.shift_sd_n, s.baseline_n) for s in shifts]
        places, shift, sd, baseline = np.array(rows).T
        sd = np.hypot(noise_scale * sd, options.scatter_fraction * baseline)
        common = options.common_scatter_fraction * baseline
        return cls(places.astype(np.int64), shift, sd, baseline, common)

    @property
    def noise(self) -> FloatArray:
        """Covariance D (n, n) of the shifts where nothing moved, in N^2."""
        return np.diag(self.sd_n**2) + np.outer(self.common_sd_n, self.common_sd_n)


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """h hypotheses of one explanation with their log probabilities (h,).

    Under each: the probability (h, n) that a hanger gained or lost more than is negligible, mean
    and standard deviation (h, n) of its shift. `members` (h, m) are the hangers that shed or
    gained; of a common shift the number of its cause.
    """

    name: ExplanationName
    log_weight: FloatArray
    members: IntArray
    gained: FloatArray
    lost: FloatArray
    mean_n: FloatArray
    sd_n: FloatArray


def weighed(bridge: Bridge, factors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log evidence (h,), mean and sd (h, n) of x ~ N(0, U U') with `factors` U (h, n, r) in N."""
    whiten = np.linalg.inv(np.linalg.cholesky(bridge.noise))
    y, u = whiten @ bridge.shift_n, whiten @ factors
    log_still = np.log(np.diag(whiten)).sum() - (y @ y + len(y) * np.log(2 * np.pi)) / 2
    precision = np.eye(u.shape[2]) + np.swapaxes(u, 1, 2) @ u
    covariance = np.linalg.inv(precision)
    along = np.einsum("hrs,hs->hr", covariance, y @ u)
    gain = (np.einsum("hr,hr->h", y @ u, along) - np.linalg.slogdet(precision)[1]) / 2
    variance = np.einsum("hnr,hrs,hns->hn", factors, covariance, factors)
    mean = np.einsum("hnr,hr->hn", factors, along)
    return log_still + gain, mean, np.sqrt(np.maximum(variance, 0))


def log_of_sign(mean: FloatArray, sd: FloatArray, members: IntArray, sign: int) -> FloatArray:
    """By how much log evidences (h,) change where the shifts of `members` (h, m) have that sign.

    For two members the signs are taken as independent, which matters only where they are in doubt.
    """
    rows = np.arange(len(members))[:, None]
    ratio = sign * mean[rows, members] / np.maximum(sd[rows, members], 1e-300)
    return np.asarray((scipy.special.log_ndtr(ratio) + np.log(2)).sum(axis=1), np.float64)


def shed_factors(bridge: Bridge, options: NeighbourOptions) -> FloatArray:
    """U (n, n, 5) for a loss of one hanger each, of one times its tension, taken up around it.

    The pattern is -1 at the hanger and Dirichlet shares at the places within two of it; U U' is its
    second moment. Shares of a hanger without a test, or beyond the bridge's end, go unseen.
    """
    near, far = options.nearest_share, options.next_share
    mean = np.array([far, near, near, far]) / (2 * (near + far))
    spread = np.diag(np.sqrt(mean)) - np.outer(mean, np.sqrt(mean))
    shares = np.column_stack([mean, spread / np.sqrt(options.share_concentration + 1)])
    away = bridge.places[None, :] - bridge.places[:, None]
    factors = np.zeros((*away.shape, 5))
    for row, distance in zip(shares, (-2, -1, 1, 2), strict=True):
        factors[away == distance] = row
    factors[away == 0, 0] = -1
    return np.asarray(factors * bridge.baseline_n[:, None, None], np.float64)


def _beyond(mean: FloatArray, sd: FloatArray, least: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Probabilities that a normal variable lies above `least`, and below minus `least`."""
    width = np.maximum(sd, 1e-300)
    return scipy.special.ndtr((mean - least) / width), scipy.special.ndtr((-mean - least) / width)


def independent(bridge: Bridge, options: NeighbourOptions) -> tuple[float, FloatArray, FloatArray]:
    """Log evidence, and probabilities (n,) of a gain and a loss, where hangers move by themselves.

    At least one moved, each with the same chance, by N(0, (size x tension)^2); the chance is
    uniform between 0 and 1, so that any number of hangers is as likely as another. Given it and the
    common part of the noise the hangers are independent: two quadratures.
    """
    its, n = bridge.sd_n**2, len(bridge.shift_n)
    left = bridge.shift_n - _COMMON[:, None] * bridge.common_sd_n
    moves = (np.array(options.sizes_fraction)[:, None] * bridge.baseline_n) ** 2
    still = _log_normal(left, its)
    by_size = _log_normal(left[:, None], its + moves) - np.log(len(moves))
    moved = scipy.special.logsumexp(by_size, axis=1)
    chance = ((1 + _CHANCE) / 2)[:, None, None]
    no, yes = np.log1p(-chance) + still, np.log(chance) + moved  # (chances, commons, n)
    either = np.logaddexp(no, yes)
    log_common = -(_COMMON**2) / 2 - scipy.special.logsumexp(-(_COMMON**2) / 2)
    weight = np.log(_CHANCE_WEIGHT / 2)[:, None] + log_common
    log_any = float(scipy.special.logsumexp(weight + either.sum(axis=2)))
    # Were nothing moved counted in here, it would be counted twice.
    log_none = min(float(scipy.special.logsumexp(weight + no.sum(axis=2))), log_any - 1e-9)
    log_some = log_any + np.log(-np.expm1(log_none - log_any))
    moving = np.einsum(
        "qc,qcn->cn", np.exp(weight + either.sum(axis=2) - log_some), np.exp(yes - either)
    )
    of_size = moving[:, None] * np.exp(by_size - moved[:, None])
    pull = moves / (moves + its)
    least = options.negligible_fraction * bridge.baseline_n
    ways = _beyond(left[:, None] * pull, np.sqrt(pull * its), least)
    gained, lost = (np.einsum("csn,csn->n", of_size, way) for way in ways)
    return float(log_some - np.log(n / (n + 1))), gained, lost


def _log_normal(left: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (left**2 / variance + np.log(2 * np.pi * variance)), np.float64)


@dataclass(frozen=True, eq=False)
class CommonCause:
    """The fractions (n,) that it moves hangers by, largest about 1; what it is, what to do."""

    fractions: FloatArray
    name: str
    remedy: str


def common_causes(shifts: Sequence[HangerShift]) -> list[CommonCause]:
    """All by one fraction; each as its temperature went, where those differ.

    A rate that is off by e moves frequencies by e, tensions by 2e.
    """
    kelvin = np.array([each.temperature_change_k for each in shifts])
    variation = float(np.sqrt(np.mean(kelvin**2)))  # NaN, and so in no range, where one is unknown
    name, clocks = "a temperature or a clock", "compare the loggers' clocks and sampling rates"
    if variation < _SWING_K:
        name = "a clock or a load on the whole deck"
        remedy = f"the temperatures hardly changed; {clocks}, and ask for new surfacing or works"
    elif kelvin.std() <= _UNLIKE * variation:
        remedy = (
            f"all tests lie about {kelvin.mean():+.0f} K from their baselines; "
            f"check the temperature readings, and {clocks}"
        )
    else:
        remedy = f"{clocks}, and the temperatures of the tests"
    causes = [CommonCause(np.ones(len(shifts)), name, remedy)]
    if variation >= _SWING_K and kelvin.std() > _UNLIKE * variation:
        remedy = "the shifts go with the temperatures of the tests; check those readings"
        causes.append(CommonCause(kelvin / np.abs(kelvin).max(), "the temperature", remedy))
    return causes


def hypotheses(
    shifts: Sequence[HangerShift], causes: Sequence[CommonCause], options: NeighbourOptions
) -> tuple[Hypotheses, ...]:
    """Everything that may have moved, at all noise scales; the probabilities add to 1."""
    by_scale = []
    for scale, prior in zip(options.noise_scales, options.noise_prior, strict=True):
        found = _at_one_scale(Bridge.of(shifts, options, scale), causes, options)
        by_scale.append([replace(e, log_weight=e.log_weight + math.log(prior)) for e in found])
    joined = [
        Hypotheses(
            group[0].name,
            *(
                np.concatenate([getattr(each, name) for each in group])
                for name in ("log_weight", "members", "gained", "lost", "mean_n", "sd_n")
            ),
        )
        for group in zip(*by_scale, strict=True)
    ]
    total = scipy.special.logsumexp(np.concatenate([each.log_weight for each in joined]))
    return tuple(replace(each, log_weight=each.log_weight - total) for each in joined)


def _probable_pairs(log_weight: FloatArray, n: int) -> IntArray:
    """Return the pairs (pairs, 2) of `n` hangers of which one is among the most probable ones."""
    probable = scipy.special.logsumexp(log_weight.reshape(-1, n), axis=0).argsort()
    first = probable[-_SUSPECTS:].tolist()
    return np.array([(i, j) for i in first for j in range(n) if i < j or j not in first])


def _independent_shifts(bridge: Bridge, options: NeighbourOptions) -> Hypotheses:
    """Return the hypothesis that hangers moved individually."""
    log_evidence, gained, lost = independent(bridge, options)
    log_weight = log_evidence + math.log(options.prior["independent shifts"])
    unknown = np.full((1, len(gained)), NAN)
    return Hypotheses(
        "independent shifts",
        np.array([log_weight]),
        np.empty((1, 0), np.int64),
        gained[None],
        lost[None],
        unknown,
        unknown,
    )


def _at_one_scale(
    bridge: Bridge, causes: Sequence[CommonCause], options: NeighbourOptions
) -> list[Hypotheses]:
    n, prior = len(bridge.shift_n), options.prior
    no_member, each = np.empty((1, 0), np.int64), np.arange(n)[:, None]
    least = options.negligible_fraction * bridge.baseline_n

    def normal(
        name: ExplanationName, prior: float, factors: FloatArray, members: IntArray, sign: int = 0
    ) -> Hypotheses:
        log_evidence, mean, sd = weighed(bridge, factors)
        log_weight = log_evidence + math.log(prior / len(factors))
        if sign:
            log_weight = log_weight + log_of_sign(mean, sd, members, sign)
        return Hypotheses(name, log_weight, members, *_beyond(mean, sd, least), mean, sd)

    def sized(factors: FloatArray, members: IntArray) -> tuple[FloatArray, IntArray]:
        """At each size, sizes running slowest."""
        sizes = options.sizes_fraction
        return np.concatenate([size * factors for size in sizes]), np.tile(members, (len(sizes), 1))

    similar = np.array([cause.fractions * bridge.baseline_n for cause in causes])[:, :, None]
    shed, of_two = shed_factors(bridge, options), options.two_hangers
    one = normal(
        "load redistribution",
        prior["load redistribution"] * (1 - of_two),
        *sized(shed, each),
        sign=-1,
    )
    # Both of two equal losses stand among the likeliest single ones.
    pairs = _probable_pairs(one.log_weight, n)
    both = np.concatenate([shed[pairs[:, 0]], shed[pairs[:, 1]]], axis=2)
    share = 2 * len(pairs) / (n * (n - 1))  # of all pairs
    return [
        normal("no change", prior["no change"], np.zeros((1, n, 1)), no_member),
        normal(
            "common shift",
            prior["common shift"],
            *sized(similar, np.arange(len(causes))[:, None]),
        ),
        one,
        normal("load gain", prior["load gain"], *sized(shed, each), sign=1),
        normal(
            "load redistribution",
            prior["load redistribution"] * of_two * share,
            *sized(both, pairs),
            sign=-1,
        ),
        _independent_shifts(bridge, options),
    ]


# ---------------------------------------------------------------- the pattern


def bridge_pattern(
    shifts: Sequence[HangerShift],
    order: Sequence[int] = (),
    options: NeighbourOptions | None = None,
) -> BridgePattern:
    """Return what moved over the bridge; shifts whose tests are older than the window are left out.

    `order` names all hangers along the bridge (index: place), so that those without a shift are
    listed. Raises NothingThere where fewer than three hangers can be compared.
    """
    from shm.watch.neighbours_words import remarks_of, sentence_of

    options = options or NeighbourOptions()
    compared, left_out = _compared(shifts, order, options.window_days)
    causes = common_causes(compared)
    found = hypotheses(compared, causes, options)
    chances: dict[ExplanationName, float] = {}
    for each in found:
        chances[each.name] = chances.get(each.name, 0.0) + float(np.exp(each.log_weight).sum())
    explanations = tuple(
        Explanation(*each) for each in sorted(chances.items(), key=lambda each: -each[1])
    )
    gained, lost = (
        sum(np.exp(each.log_weight) @ getattr(each, way) for each in found)
        for way in ("gained", "lost")
    )
    rows = tuple(map(_row, compared, gained.tolist(), lost.tolist()))
    suspects = _suspects(compared, found)
    fraction, sd, cause = _common_shift(compared, found, causes)
    pattern = BridgePattern(
        newest=max(each.time for each in compared),
        explanations=explanations,
        suspects=suspects,
        rows=rows,
        sum_kept=_sum_kept(Bridge.of(compared, options), rows, explanations, suspects),
        alike_fraction=fraction,
        alike_sd=sd,
        alike_cause=cause.name,
        not_compared=left_out,
        sentence="",
    )
    sentence = sentence_of(pattern, cause.remedy, options.named_from)
    return replace(pattern, sentence=sentence, remarks=remarks_of(pattern))


def _row(shift: HangerShift, gained: float, lost: float) -> HangerRow:
    ways: dict[Way, float] = {"unchanged": 1 - gained - lost, "gained": gained, "lost": lost}
    way = max(ways, key=lambda each: ways[each])
    half = NINETY_PERCENT * shift.shift_sd_n
    mean, low, high = shift.shift_n, shift.shift_n - half, shift.shift_n + half
    n = shift.baseline_n
    return HangerRow(
        shift.hanger, shift.place, shift.position_m, shift.time, n, mean, low, high,
        mean / n, low / n, high / n, way, max(0.0, ways[way]), gained, lost,
    )  # fmt: skip


def _suspects(shifts: Sequence[HangerShift], found: Sequence[Hypotheses]) -> tuple[Suspect, ...]:
    """Return the likeliest few of those who shed or gained load."""
    suspects = []
    for each in found:
        if each.name not in ("load redistribution", "load gain"):
            continue
        for members in np.unique(each.members, axis=0):
            rows = (each.members == members).all(axis=1)
            mean, sd = _mixed(
                each.log_weight[rows], *(v[rows][:, members] for v in (each.mean_n, each.sd_n))
            )
            hangers = tuple(shifts[index].hanger for index in members)
            chance = float(np.exp(each.log_weight[rows]).sum())
            suspects.append(
                Suspect(each.name, hangers, chance, tuple(mean.tolist()), tuple(sd.tolist()))
            )
    return tuple(sorted(suspects, key=lambda each: -each.probability)[:_SUSPECTS])


def _mixed(
    log_weights: FloatArray, means: FloatArray, sds: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation (m,) of a mixture of h normal distributions (h, m)."""
    weights = np.exp(log_weights - scipy.special.logsumexp(log_weights))
    mean = weights @ means
    return mean, np.sqrt(np.maximum(weights @ (sds**2 + means**2) - mean**2, 0))


def _common_shift(
    shifts: Sequence[HangerShift], found: Sequence[Hypotheses], causes: Sequence[CommonCause]
) -> tuple[float, float, CommonCause]:
    """The mean fraction of the hangers that the likeliest common cause moves, its sd, the cause."""
    similar = next(each for each in found if each.name == "common shift")
    cause = similar.members[:, 0]
    best = int(np.bincount(cause, np.exp(similar.log_weight - similar.log_weight.max())).argmax())
    rows, touched = cause == best, causes[best].fractions != 0
    baseline = np.array([each.baseline_n for each in shifts])
    mean, sd = _mixed(
        similar.log_weight[rows],
        *(
            (v[rows] / baseline)[:, touched].mean(axis=1, keepdims=True)
            for v in (similar.mean_n, similar.sd_n)
        ),
    )
    return float(mean[0]), float(sd[0]), causes[best]


def _sum_kept(
    bridge: Bridge,
    rows: Sequence[HangerRow],
    explanations: Sequence[Explanation],
    suspects: Sequence[Suspect],
) -> SumKept:
    """The sum over those who moved with their neighbours; over all where nobody stands out."""
    best = explanations[0].name
    movers = next((each.hangers for each in suspects if each.name == best), ())
    if best == "independent shifts":
        movers = tuple(row.hanger for row in rows if row.way != "unchanged")
    centres = [row.place for row in rows if row.hanger in movers]
    wanted = {centre + step for centre in centres for step in range(-REACH, REACH + 1)}
    wanted = wanted or set(range(min(bridge.places), max(bridge.places) + 1))
    group = [index for index, row in enumerate(rows) if row.place in wanted]
    keeping = ("no change", "load redistribution", "load gain")
    return SumKept(
        hangers=tuple(rows[index].hanger for index in group),
        sum_n=float(bridge.shift_n[group].sum()),
        sum_sd_n=float(np.sqrt(bridge.noise[np.ix_(group, group)].sum())),
        probability=min(1.0, sum(e.probability for e in explanations if e.name in keeping)),
        complete=len(wanted) == len(group),
    )
