"""Effects in words: a name with its place for tables, a clause with its size for sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from shm.report import words
from shm.report.diagnosis.sizes import Sizes
from shm.values import Cause, EffectEstimate, effect_label
from shm.values.diagnosis import joined

_PLACES = {
    "everywhere": "",
    "deck end": "at the deck end",
    "arch end": "at the arch end",
    "both ends": "at both ends",
    "all sensors": "of all sensors",
    "all tests": "in all tests",
    "transverse": "in the transverse plane",
    "longitudinal": "in the longitudinal plane",
    "both planes alike": "in both planes alike",
}
_MOST_PLACES = 2
_PLACE_STARTS = {"sensor": "of the", "test": "in"}

PHRASES: dict[str, Callable[[Sizes], str]] = {
    "rotational_end_flexibility": lambda s: f"ends that turn against springs of {s.springs('k')}",
    "translational_end_flexibility": lambda s: (
        f"ends that give way sideways against springs of {s.springs('kt')}"
    ),
    "effective_length": lambda s: (
        f"an effective length {s['length_change_m'].directed('longer', 'shorter')} than described"
    ),
    "bending_stiffness": lambda s: (
        f"a bending stiffness {s['stiffness_change'].directed('higher', 'lower')} than described"
    ),
    "distributed_mass": lambda s: (
        f"a mass per length {s['mass_change'].directed('higher', 'lower')} than described"
    ),
    "point_mass": lambda s: f"a point mass of {s['mass_kg']} at {s['x_m']}",
    "section_loss": lambda s: (
        f"a loss of {s['loss']} of the section around {s['x_m']}, over {s['extent_m']}"
    ),
    "stiff_end_zones": lambda s: (
        f"end zones of {s['zone_m']} with a bending stiffness of {s['stiffness_ratio']}"
    ),
    "shear_and_rotary_inertia": lambda s: f"shear and rotary inertia, {s['share']} of Timoshenko",
    "sag": lambda s: f"sag with Irvine's lambda squared of {s['sag_parameter']}",
    "intermediate_support": lambda s: (
        f"an intermediate support of {s['stiffness_n_m']} at {s['x_m']}"
    ),
    "support_motion": lambda s: (
        f"a support that moves as a mass of {s['support_mass_kg']} with a frequency of its own of "
        f"{s['support_frequency_hz']}"
    ),
    "temperature_tension": lambda s: (
        "a tension that changes with the temperature, by "
        f"{s['tension_per_kelvin_n_k'].directed('(rising)', '(falling)')}"
    ),
    "geometric_hardening": lambda s: (
        f"a tension that grows with the level of motion, by {s['hardening']} at the reference level"
    ),
    "joint_softening": lambda s: (
        "joints that soften as the hanger moves more, with "
        f"{s['log10_k_at_reference_level']} at the reference level"
    ),
    "sensor_mass": lambda s: f"the mass of the sensors, {s['mass_kg']} each",
    "sensor_misalignment": lambda s: f"a sensor direction turned by {s['angle_deg']}",
    "skewed_principal_axes": lambda s: (
        f"ends that turn about one axis only, {s['angle_deg']} from the transverse plane, against "
        f"{s['log10_k']}"
    ),
    "timebase": lambda s: (
        f"a clock by which frequencies read {s['clock_error'].directed('too high', 'too low')}"
    ),
}


def title(effect: str) -> str:
    """`point_mass + sag` as `point mass + sag`."""
    return words.quantity(effect)


def label(cause: Cause) -> str:
    """`rotational end flexibility (both ends)`, for tables and figures."""
    parts = zip(cause.effects, cause.places, strict=True)
    return joined(effect_label(effect, at) for effect, at in parts)


def phrase(cause: Cause) -> str:
    """`a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7)`; a pair joined by `and`."""
    clauses = [
        _clause(effect, at, own_estimates(cause, number))
        for number, (effect, at) in enumerate(zip(cause.effects, cause.places, strict=True))
    ]
    return " together with ".join(clauses) + _also(cause)


def _also(cause: Cause) -> str:
    """Where else it may act as well."""
    if not cause.also_at:
        return ""
    places = [
        " and ".join(_place(part) or "everywhere" for part in cause.each_at(at))
        for at in cause.also_at[:_MOST_PLACES]
    ]
    return f" (about as likely: {words.listed(places)})"


def _clause(effect: str, at: str, estimates: Sequence[EffectEstimate]) -> str:
    """What the effect is, how large, where; the bare name where its size is not known."""
    where = _place(at)
    try:
        told = PHRASES[effect](Sizes(estimates))
    except KeyError:
        told = title(effect)
    return f"{told} {where}".rstrip()


def _place(at: str) -> str:
    """`deck end, transverse` as `at the deck end in the transverse plane`."""
    return " ".join(filter(None, (_place_part(part) for part in at.split(", "))))


def _place_part(part: str) -> str:
    start = _PLACE_STARTS.get(part.partition(" ")[0])
    return _PLACES.get(part, f"{start} {part}" if start else part)


def own_estimates(cause: Cause, number: int) -> tuple[EffectEstimate, ...]:
    """The estimates of effect `number` of the cause.

    In a pair a name that both have carries its effect before a dot.
    """
    prefixed = {e.name: e.name.partition(".")[0] for e in cause.parameters if "." in e.name}
    own = cause.effects[number]
    return tuple(e for e in cause.parameters if prefixed.get(e.name, own) == own)
