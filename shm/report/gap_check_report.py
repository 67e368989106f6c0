"""Report in words what a gap diagnosis would find on a hanger with its tests."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.report import formatting
from shm.report.sizes import size
from shm.values import NAN, EffectCheck, EffectEstimate, GapCheck, GapTrial, effect_label
from shm.values.rounding import force_unit

HEADINGS = ("effect", "found from", "there together with", "alone from", "largest that was missed")


def rows(check: GapCheck) -> list[tuple[str, ...]]:
    """Return a row of texts for each effect, in the order of the catalogue."""
    return [
        (
            planted(effect),
            found_from(effect),
            _names(effect.others) if effect.others else "",
            _from(effect, effect.alone_from),
            missed(effect),
        )
        for effect in check.effects
    ]


def planted(effect: EffectCheck) -> str:
    """Return the effect and where it was planted: `point mass at 3.4 m`."""
    labels = {effect_label(trial.effect, trial.at) for trial in effect.trials}
    places_m = {p.value for trial in effect.trials for p in trial.parameters if p.name == "x_m"}
    if len(labels) > 1 or len(places_m) > 1:
        return f"{formatting.quantity(effect.effect)} (several places)"
    return " at ".join([*labels, *(f"{x_m:.2g} m" for x_m in places_m)])


def size_words(effect: EffectCheck, step: int) -> str:
    """Return a size in the unit that suits it: `24 kg`, `1.5 %`."""
    value = effect.sizes[step]
    return str(size(EffectEstimate(effect.name, effect.unit, value, NAN, NAN, NAN)))


def found_from(effect: EffectCheck) -> str:
    """Return the smallest size that is found: `24 kg or more`, of a spring `or less`."""
    return _from(effect, effect.found_from) or "not found"


def _from(effect: EffectCheck, step: int | None) -> str:
    if step is None:
        return ""
    side = "less" if effect.sizes[0] > effect.sizes[-1] else "more"
    return f"{size_words(effect, step)} or {side}"


def missed(effect: EffectCheck) -> str:
    """Return the largest size that was not found, and what the diagnosis says of it."""
    if not effect.missed:
        return "none"
    statement = dict.fromkeys(_missed(trial) for trial in effect.missed)
    return f"{size_words(effect, effect.missed[0].step)}: {' or '.join(statement)}"


def _missed(trial: GapTrial) -> str:
    words = {
        "no gap": "not visible",
        "unexplained": "taken for something unknown",
        "refused": "refused: nothing fits",
    }
    return words.get(trial.outcome) or f"taken for {_names(trial.others)}"


def _names(names: Sequence[str], most: int = 2) -> str:
    """Return effects in words, the first ones by name."""
    shown = [formatting.quantity(name) for name in names[:most]]
    rest = len(names) - most
    return formatting.listed([*shown, formatting.counted(rest, "other")] if rest > 0 else shown)


def introduction(check: GapCheck) -> str:
    """Return what the twin is and what was done with it."""
    whose = f"hanger {check.hanger}" if check.hanger is not None else "the hanger"
    if check.tests:
        count = formatting.counted(len(check.tests), "test")
        source = (
            f"{check.baseline} fitted to {count}; it misses their frequencies by "
            f"{check.misfit_percent:.2g} %"
        )
    else:
        source = f"{check.baseline} as described with a usual hammer test, for no test is there"
    tension = ""
    if math.isfinite(check.tension_n):
        unit = force_unit(check.tension_n)
        tension = f", tension {formatting.rounded_tension(check.tension_n, unit)}"
    return (
        f"The twin of {whose}: {source}{tension}. Frequencies err by "
        f"{check.frequency_sd_percent:.2g} %. Each effect was planted at a random place."
    )


def sound_words(check: GapCheck) -> str:
    """Return in how many twins without an effect a gap is claimed."""
    if not check.sound:
        return ""
    return f"Twins without an effect: a gap is claimed in {check.false_gaps} of {len(check.sound)}."


def invisible_words(check: GapCheck) -> list[str]:
    """Return a line for each effect that these data cannot show."""
    return [f"{formatting.quantity(name)}: {why}" for name, why in check.invisible]


def stopped_words(check: GapCheck) -> str:
    """Return how much is done if it was stopped; empty for others."""
    if check.is_complete:
        return ""
    return f"Stopped: {check.searches_done} of {check.searches} searches are done."


def check_text(check: GapCheck) -> list[str]:
    """Return what is said below the table, a paragraph each."""
    limit = (
        "The limit lies between the largest that was missed and the smallest that is found. "
        "The twin follows the model of the diagnosis exactly: on the bridge it may take more."
    )
    hidden = invisible_words(check)
    lines = [stopped_words(check), sound_words(check), limit]
    lines += ["Not visible with these data:", *(f"- {each}" for each in hidden)] if hidden else []
    return [each for each in lines if each]
