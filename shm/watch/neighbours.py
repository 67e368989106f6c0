"""Explain the shifts of tension along a bridge together: who shed load, and who took it up.

The shifts y (n,) of the compared hangers are y = x + e, e ~ N(0, D): the variance of each hanger
and a small part common to all. An explanation is a set of hypotheses x ~ N(0, U U') with a factor
U (n, r), so that evidence and posterior have a closed form (Rasmussen and Williams 2006, appendix
A.3); a loss or a gain is the half of that law with its sign. Only "independent shifts" is another
law: each hanger moved or did not.
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
from shm.watch.engine.limits import LIMITS

ExplanationName = Literal[
    "no change", "load redistribution", "load gain", "common shift", "independent shifts"
]
Way = Literal["gained", "lost", "unchanged"]

REACH = 2  # places: what hangers further off take up is below 5 % of a loss


@dataclass(frozen=True)
class HangerShift:
    """The shift of a hanger's tension from its baseline at its latest test.

    `place` counts the hangers along the bridge, those without a test too; two rows of hangers stand
    in one count if three places or more are left free between them.
    """

    hanger: int
    place: int
    time: datetime
    baseline_n: float
    shift_n: float
    shift_sd_n: float
    position_m: float = NAN


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

    `suspects` are the most probable hangers to have shed or gained load. `alike_fraction` and its
    sd are the common shift if all moved alike, and `alike_cause` what that would be put down to.
    `sentence` and `remarks` state it to the owner.
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


ALIKE_CAUSE = "a temperature, a clock or a load on the whole deck"


def shifts_of(
    drifts_by_hanger: Mapping[int, Sequence[Drift]], order: Sequence[int]
) -> tuple[HangerShift, ...]:
    """Return the latest known tension shift of each hanger that has one, in their `order`.

    `order` names all hangers along the bridge: a place is an index into it.
    """
    found = []
    for place, hanger in enumerate(order):
        known = [each for each in drifts_by_hanger.get(hanger, ()) if _is_known(each)]
        if known:
            # Of two at one time the later in the list is of the newer baseline.
            latest = max(reversed(known), key=lambda each: each.time)
            n = latest.baseline
            size = latest.shift_mean * n, latest.shift_sd * n
            found.append(HangerShift(hanger, place, latest.time, n, *size))
    return tuple(found)


def _is_known(drift: Drift) -> bool:
    numbers = drift.baseline, drift.shift_mean, drift.shift_sd
    usable = all(map(math.isfinite, numbers)) and drift.baseline > 0 < drift.shift_sd
    return drift.quantity == TENSION and usable


def weigh_pattern(
    shifts: Sequence[HangerShift],
    order: Sequence[int] = (),
    options: NeighbourOptions | None = None,
) -> BridgePattern:
    """Weigh what moved over the bridge; shifts whose tests are older than the window are left out.

    `order` names all hangers along the bridge (index: place), so that those without a shift are
    listed. Raises NothingThere where fewer than three hangers can be compared.
    """
    options = options or NeighbourOptions()
    compared, left_out = _compared(shifts, order, options.window_days)
    bridge, groups = _Bridge.of(compared, options), _weigh(compared, options)
    chances: dict[ExplanationName, float] = {}
    for each in groups:
        chances[each.name] = chances.get(each.name, 0.0) + float(each.weight.sum())
    ranked = sorted(chances.items(), key=lambda each: -each[1])
    gained, lost = (
        sum(each.weight @ getattr(each, way) for each in groups) for way in ("gained", "lost")
    )
    rows = tuple(map(_row, compared, gained.tolist(), lost.tolist()))
    suspects = _suspects(compared, groups)
    common = [each for each in groups if each.name == "common shift"]
    fraction, sd = _mix(
        np.concatenate([each.weight for each in common]),
        *(
            np.concatenate([v / bridge.baseline_n for v in values]).mean(axis=1)
            for values in ([each.mean_n for each in common], [each.sd_n for each in common])
        ),
    )
    return BridgePattern(
        newest=max(each.time for each in compared),
        explanations=tuple(Explanation(*each) for each in ranked),
        suspects=suspects,
        rows=rows,
        sum_kept=_conserved_sum(bridge, rows, chances, suspects, ranked[0][0]),
        alike_fraction=float(fraction),
        alike_sd=float(sd),
        alike_cause=ALIKE_CAUSE,
        not_compared=left_out,
        sentence="",
    )


def _compared(
    shifts: Sequence[HangerShift], order: Sequence[int], days: float
) -> tuple[list[HangerShift], tuple[NotCompared, ...]]:
    """Return the shifts of the last `days`, by place, and the hangers that are left out."""
    oldest = max((s.time for s in shifts), default=datetime.max) - timedelta(days=days)
    by_place = sorted(shifts, key=lambda each: each.place)
    recent = [each for each in by_place if each.time >= oldest]
    if len(recent) < LIMITS.neighbours_fewest:
        few = (
            f"{len(shifts)} of the hangers have a shift from a baseline"
            if len(shifts) < LIMITS.neighbours_fewest
            else f"{len(recent)} of the hangers have a test of the last {days:g} days"
        )
        raise NothingThere(
            f"only {few}; a pattern over the bridge needs {LIMITS.neighbours_fewest}.",
            remedy="Test more hangers, in one campaign: the first tests of each form its baseline.",
        )
    old = f"its latest test is more than {days:g} days older than the newest"
    left_out = [NotCompared(s.hanger, s.place, s.time, old) for s in by_place if s.time < oldest]
    tested = {each.hanger for each in shifts}
    why = "no test of it has been compared with a baseline"
    left_out += [NotCompared(h, at, None, why) for at, h in enumerate(order) if h not in tested]
    return recent, tuple(sorted(left_out, key=lambda each: each.place))


# ---------------------------------------------------------------- hypotheses and their evidence


@dataclass(frozen=True, eq=False)
class _Bridge:
    """Shifts, their noise and the tensions they started from, each (n,); `places` (n,) along it."""

    places: IntArray
    shift_n: FloatArray
    sd_n: FloatArray
    baseline_n: FloatArray
    common_sd_n: FloatArray

    @classmethod
    def of(
        cls, shifts: Sequence[HangerShift], options: NeighbourOptions, noise_scale: float = 1.0
    ) -> _Bridge:
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
class _Group:
    """h hypotheses of one explanation: `weight` (h,), first a logarithm, then a probability.

    Under each: the probability (h, n) that a hanger gained or lost more than is negligible, mean
    and standard deviation (h, n) of its shift; `members` (h, m) are those that shed or gained.
    """

    name: ExplanationName
    weight: FloatArray
    members: IntArray
    gained: FloatArray
    lost: FloatArray
    mean_n: FloatArray
    sd_n: FloatArray


def _weigh(shifts: Sequence[HangerShift], options: NeighbourOptions) -> list[_Group]:
    """Return all that may have moved, at all noise scales; the probabilities add to 1."""
    groups = [
        replace(each, weight=each.weight + math.log(prior))
        for scale, prior in zip(options.noise_scales, options.noise_prior, strict=True)
        for each in _at_one_scale(_Bridge.of(shifts, options, scale), options)
    ]
    total = scipy.special.logsumexp(np.concatenate([each.weight for each in groups]))
    return [replace(each, weight=np.exp(each.weight - total)) for each in groups]


def _at_one_scale(bridge: _Bridge, options: NeighbourOptions) -> list[_Group]:
    n, prior, sizes = len(bridge.shift_n), options.prior, options.sizes_fraction
    none, each = np.empty((1, 0), np.int64), np.arange(n)[:, None]

    def normal(
        name: ExplanationName, prior: float, factors: FloatArray, members: IntArray, sign: int = 0
    ) -> _Group:
        """Weigh `factors` at each size; members move with the `sign`, if there is one."""
        factors = np.concatenate([size * factors for size in sizes])
        members = np.tile(members, (len(sizes), 1))
        log_evidence, mean, sd = _evidence(bridge, factors)
        log_weight = log_evidence + math.log(prior / len(factors))
        if sign:  # two members as independent, which matters only where they are in doubt
            rows = np.arange(len(members))[:, None]
            ratio = sign * mean[rows, members] / np.maximum(sd[rows, members], 1e-300)
            log_weight = log_weight + (scipy.special.log_ndtr(ratio) + math.log(2)).sum(axis=1)
        ways = _beyond(mean, sd, options.negligible_fraction * bridge.baseline_n)
        return _Group(name, log_weight, members, *ways, mean, sd)

    shed, of_two = _shed_factors(bridge, options), options.two_hangers
    loss = prior["load redistribution"]
    one = normal("load redistribution", loss * (1 - of_two), shed, each, sign=-1)
    # Both of two equal losses are among the most probable single ones.
    first = scipy.special.logsumexp(one.weight.reshape(-1, n), axis=0).argsort()[-LIMITS.suspects :]
    pairs = np.array([(i, j) for i in first for j in range(n) if i < j or j not in first])
    both = np.concatenate([shed[pairs[:, 0]], shed[pairs[:, 1]]], axis=2)
    of_two *= 2 * len(pairs) / (n * (n - 1))
    return [
        normal("no change", prior["no change"], np.zeros((1, n, 1)), none),
        normal("common shift", prior["common shift"], bridge.baseline_n[None, :, None], none),
        one,
        normal("load gain", prior["load gain"], shed, each, sign=1),
        normal("load redistribution", loss * of_two, both, pairs, sign=-1),
        _independent_shifts(bridge, options),
    ]


def _evidence(bridge: _Bridge, factors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
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


def _shed_factors(bridge: _Bridge, options: NeighbourOptions) -> FloatArray:
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


def _independent_shifts(bridge: _Bridge, options: NeighbourOptions) -> _Group:
    """Weigh that at least one hanger moved, each with the same chance, individually.

    A move is N(0, (size x tension)^2); the chance is uniform between 0 and 1, so that any number of
    hangers is as probable as another.
    """
    n, y, sizes = len(bridge.shift_n), bridge.shift_n, np.array(options.sizes_fraction)
    noise = bridge.sd_n**2 + bridge.common_sd_n**2
    moves = (sizes[:, None] * bridge.baseline_n) ** 2
    by_size = _log_normal(y, noise + moves) - np.log(len(sizes))
    moved = scipy.special.logsumexp(by_size, axis=0)
    nodes, weights = np.polynomial.legendre.leggauss(16)  # exact to degree 31
    chance, log_chance = ((1 + nodes) / 2)[:, None], np.log(weights / 2)
    no, yes = np.log1p(-chance) + _log_normal(y, noise), np.log(chance) + moved
    either = np.logaddexp(no, yes)
    log_any = log_chance + either.sum(axis=1)
    # Were nothing moved counted in here, it would be counted twice.
    total = scipy.special.logsumexp(log_any)
    log_none = min(float(scipy.special.logsumexp(log_chance + no.sum(axis=1))), total - 1e-9)
    log_some = total + np.log(-np.expm1(log_none - total))
    of_size = np.exp(log_any - log_some) @ np.exp(yes - either) * np.exp(by_size - moved)
    pull = moves / (moves + noise)
    least = options.negligible_fraction * bridge.baseline_n
    ways = _beyond(y * pull, np.sqrt(pull * noise), least)
    gained, lost = ((of_size * way).sum(axis=0)[None] for way in ways)
    log_weight = np.array([log_some - np.log(n / (n + 1))])
    log_weight += math.log(options.prior["independent shifts"])
    unknown = np.full((1, n), NAN)
    none = np.empty((1, 0), np.int64)
    return _Group("independent shifts", log_weight, none, gained, lost, unknown, unknown)


def _log_normal(y: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (y**2 / variance + np.log(2 * np.pi * variance)), np.float64)


def _beyond(mean: FloatArray, sd: FloatArray, least: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the probabilities of a normal variable above `least`, and below minus `least`."""
    width = np.maximum(sd, 1e-300)
    return scipy.special.ndtr((mean - least) / width), scipy.special.ndtr((-mean - least) / width)


# ---------------------------------------------------------------- summary


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


def _suspects(shifts: Sequence[HangerShift], groups: Sequence[_Group]) -> tuple[Suspect, ...]:
    """Return the most probable few of those who shed or gained load."""
    found: dict[tuple[ExplanationName, tuple[int, ...]], list[tuple[FloatArray, ...]]] = {}
    for each in groups:
        if each.members.shape[1]:
            rows = zip(each.members.tolist(), each.weight, each.mean_n, each.sd_n, strict=True)
            for members, *values in rows:
                found.setdefault((each.name, tuple(members)), []).append(tuple(values))
    suspects = []
    for (name, members), values in found.items():
        weight, mean_n, sd_n = (np.array(column) for column in zip(*values, strict=True))
        mean, sd = _mix(weight, mean_n[:, members], sd_n[:, members])
        hangers = tuple(shifts[index].hanger for index in members)
        size = tuple(mean.tolist()), tuple(sd.tolist())
        suspects.append(Suspect(name, hangers, float(weight.sum()), *size))
    return tuple(sorted(suspects, key=lambda each: -each.probability)[: LIMITS.suspects])


def _mix(weight: FloatArray, mean: FloatArray, sd: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and sd of a mixture of h normal distributions, `mean` and `sd` (h, ...)."""
    weight = np.maximum(weight, 1e-300) / np.maximum(weight, 1e-300).sum()
    middle = weight @ mean
    return middle, np.sqrt(np.maximum(weight @ (sd**2 + mean**2) - middle**2, 0))


def _conserved_sum(
    bridge: _Bridge,
    rows: Sequence[HangerRow],
    chances: Mapping[ExplanationName, float],
    suspects: Sequence[Suspect],
    best: ExplanationName,
) -> SumKept:
    """Sum over those who moved with their neighbours; over all where nobody stands out."""
    movers = next((each.hangers for each in suspects if each.name == best), ())
    if best == "independent shifts":
        movers = tuple(row.hanger for row in rows if row.way != "unchanged")
    centres = [row.place for row in rows if row.hanger in movers]
    wanted = {centre + step for centre in centres for step in range(-REACH, REACH + 1)}
    wanted = wanted or set(range(min(bridge.places), max(bridge.places) + 1))
    group = [index for index, row in enumerate(rows) if row.place in wanted]
    probability = chances["no change"] + chances["load redistribution"] + chances["load gain"]
    return SumKept(
        hangers=tuple(rows[index].hanger for index in group),
        sum_n=float(bridge.shift_n[group].sum()),
        sum_sd_n=float(np.sqrt(bridge.noise[np.ix_(group, group)].sum())),
        probability=min(1.0, probability),
        complete=len(wanted) == len(group),
    )
