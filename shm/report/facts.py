"""The figures on top of a hanger's report."""

from __future__ import annotations

from shm.report import words
from shm.report.content import HangerReport, of_nominal
from shm.report.summary import is_found, tension_change
from shm.values.stated_tension import StatedTension, stated


def facts(data: HangerReport) -> tuple[tuple[str, str, str], ...]:
    """What, value, what stands beside it."""
    unit = data.tension_unit
    said = stated(data.averaged, unit)
    repeats = f"; repeatability {said.repeatability}" if said.repeatability else ""
    return (
        ("Tension", said.tension, f"90 % interval {said.interval}{repeats}"),
        *_limits(data, said),
        _of_nominal(data),
        _since_baseline(data),
        (
            "Latest test",
            words.moment(data.latest.time),
            words.temperature(data.latest.temperature_c),
        ),
        (
            "Model class",
            words.model_class(data.posterior.model),
            f"{words.counted(len(data.latest.modes), 'mode')} identified",
        ),
    )


def _limits(data: HangerReport, said: StatedTension) -> tuple[tuple[str, str, str], ...]:
    """The probabilities that the owner's limits ask for."""
    limits, unit = data.hanger.limits, data.tension_unit
    asked = (
        ("Above its limit", said.above, limits.tension_max_n),
        ("Slack", said.slack, limits.tension_min_n),
    )
    return tuple(
        (what, probability, f"probability; limit {words.rounded_tension(limit_n, unit)}")
        for what, probability, limit_n in asked
        if probability
    )


def _of_nominal(data: HangerReport) -> tuple[str, str, str]:
    share = of_nominal(data.tension_n, data.hanger)
    if share is None:
        return ("Of nominal", "not known", "the hanger has no nominal tension")
    nominal = words.rounded_tension(data.hanger.nominal_tension_n, data.tension_unit)
    return (
        "Of nominal",
        f"{words.mean(share)} %",
        f"90 % interval {words.span(share)} %; nominal {nominal}",
    )


def _since_baseline(data: HangerReport) -> tuple[str, str, str]:
    change = tension_change(data)
    if change is None:
        return ("Since the baseline", "first test", "nothing earlier to compare with")
    percent = change.scaled(100)
    return (
        "Since the baseline",
        f"{words.mean(percent, signed=True)} %",
        f"90 % interval {words.span(percent, signed=True)} %"
        f"{'' if is_found(data) else ', if it has moved at all'}",
    )
