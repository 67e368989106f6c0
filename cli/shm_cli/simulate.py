"""`shm simulate`: hammer tests of a hanger whose truth is chosen."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np
import rich_click as click

from shm.errors import UsageError
from shm.models.classes.base import Conditions
from shm.read import FORMATS, write
from shm.simulate import (
    AmbientPlan,
    HammerPlan,
    HangerState,
    PlantedEffect,
    ambient_test,
    hammer_test,
    spread_places_m,
)
from shm.simulate.effects import plantable_effects
from shm.values import AddedMass, Hanger, Recording
from shm_cli import flags
from shm_cli.common import answer, counting_bar, one_hanger

_FIRST = datetime(2026, 1, 5, 10, tzinfo=UTC)  # any: the same call gives the same files
_SUFFIXES = sorted(known.suffixes[0].lstrip(".") for known in FORMATS if known.write)
# Judgement: a hanger rings for some 20 s; 0.02 m/s^2 is a good accelerometer in calm air; two
# places tell the orders of modes apart.
_HAMMER_SECONDS, _HAMMER_NOISE = 20.0, 0.02
_SENSORS = 2


class Chosen(TypedDict):
    """Planted truth, measurement set-up and the header of each recording."""

    tension_n: float | None
    k1: float
    k2: float
    k3: float
    k4: float
    damping: float
    noise: float | None
    sensors: int | None
    hits: int
    hammer_x: float
    seconds: float | None
    rate: float
    ambient: bool
    temperature_c: float
    effects: tuple[str, ...]
    reference_c: float
    amplitude: float
    added_mass: str | None


def _springs(function: flags.F) -> flags.F:
    """Add `--k1` to `--k4`."""
    planes = ("Transverse", "Longitudinal")
    for number in (4, 3, 2, 1):
        where = f"{planes[(number - 1) % 2]}, {'deck' if number < 3 else 'arch'} end"
        help_text = f"{where}. End spring in N m/rad; clamped if left out."
        option = click.option(
            f"--k{number}", type=float, default=math.inf, show_default=False, help=help_text
        )
        function = option(function)
    return function


@click.command()
@flags.hanger()
@flags.hanger_file
@click.option("--tension-n", type=float, help="Planted tension; the nominal one if left out.")
@_springs
@click.option("--damping", type=float, default=0.001, help="Damping ratio.")
@click.option("--noise", type=float, help="In m/s^2; 0.02, or 0.002 where nobody hits.")
@click.option(
    "--sensors",
    type=click.IntRange(1, 8),
    help="Places with a biaxial accelerometer each; 2 if left out.",
)
@click.option("--hits", type=click.IntRange(1, 50), default=5)
@click.option(
    "--hammer-x",
    type=float,
    default=math.nan,
    show_default=False,
    help="Where the hammer hits, in m from the deck end; 0.16 of the length if left out.",
)
@click.option("--seconds", type=float, help="Seconds a hit; 20, or 600 in all where nobody hits.")
@click.option("--rate", type=float, default=512.0, help="Samples a second.")
@click.option("--ambient", is_flag=True, help="Wind and traffic drive the hanger, nobody hits.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME:AT:param=value,...",
    help="What is planted beside the springs, may be repeated: where it acts and all its "
    "parameters, as `shm gap` names them; 'point_mass:everywhere:mass_kg=12,x_m=3.4' or "
    "'rotational_end_flexibility:deck end, transverse:log10_k1=6.8' for instance. Names: "
    f"{', '.join(plantable_effects())}.",
)
@click.option(
    "--amplitude",
    type=float,
    default=1.0,
    help="Level of the hits: effects follow it, and so does the force.",
)
@click.option(
    "--reference-c",
    type=float,
    default=10.0,
    help="Temperature at which the tension is the planted one.",
)
@click.option(
    "--added-mass",
    metavar="KG:X[:RADIUS]",
    help="A known mass, clamped on at X m: a point, or a body with a RADIUS of gyration in m.",
)
@click.option("--tests", type=click.IntRange(1, 10_000), default=1)
@click.option(
    "--temperature-c",
    type=float,
    default=math.nan,
    show_default=False,
    help="Unknown if left out.",
)
@click.option("--first", type=flags.Time(), help="Time of the first test; then weekly.")
@click.option("--format", "form", type=click.Choice(_SUFFIXES), default="csv")
@click.option("--out", type=flags.FOLDER, metavar="DIR", required=True, help="Where the files go.")
@flags.seed
@flags.json
@click.pass_context
def command(
    ctx: click.Context,
    hanger_id: int | None,
    hanger_file: Path | None,
    tests: int,
    first: datetime | None,
    form: str,
    out: Path,
    seed: int,
    **chosen: Unpack[Chosen],
) -> None:
    """Simulate hammer tests of a hanger.

    The hits are simulated in the time domain, with biaxial accelerometers. Effects of the gap
    diagnosis can be included.

    \b
    Example: shm simulate --hanger-file H.toml --k1 1e7 --k3 1e7 --out tests
    """
    hanger = one_hanger(ctx, hanger_file, hanger_id)
    _refuse_other_supports(hanger)
    start = first or _FIRST
    out.mkdir(parents=True, exist_ok=True)
    written = []
    with counting_bar() as bar:
        for week in bar.track(range(tests), description="simulating"):
            time = start + timedelta(weeks=week)
            rng = np.random.default_rng([seed, week])
            name = f"hanger{hanger.id}_{time:%Y%m%dT%H%M%S}.{form}"
            recording = replace(_recording(hanger, chosen, rng), source=name, time=time)
            write(recording, out / name)
            written.append(out / name)
    files = [str(path) for path in written]
    answer({"files": files}, "\n".join(files))


def _refuse_other_supports(hanger: Hanger) -> None:
    """Raise UsageError unless the hanger is clamped or on springs, and in tension."""
    if hanger.as_hanger:
        return
    held = "" if hanger.supports.clamped else "is not clamped at both ends"
    slack = "" if hanger.nominal_tension_n > 0 else "carries no tension"
    raise UsageError(
        f"hanger {hanger.id} {' and '.join(filter(None, (held, slack)))}: only bars that are "
        "clamped or on springs at both ends, and in tension, can be simulated.",
        remedy="Leave out [hanger.supports] and give a nominal tension above 0; soft ends are "
        "--k1 to --k4.",
    )


def _recording(hanger: Hanger, chosen: Chosen, rng: np.random.Generator) -> Recording:
    make = _listened if chosen["ambient"] else _hit
    recording = make(hanger, _state(hanger, chosen), chosen, rng)
    mass = _conditions(chosen).added_mass
    return replace(recording, temperature_c=chosen["temperature_c"], added_mass=mass)


def _state(hanger: Hanger, chosen: Chosen) -> HangerState:
    given_n = chosen["tension_n"]
    tension_n = hanger.nominal_tension_n if given_n is None else given_n
    springs = (chosen["k1"], chosen["k2"], chosen["k3"], chosen["k4"])
    return HangerState(tension_n, *springs, damping_ratio=chosen["damping"])


def _hit(hanger: Hanger, state: HangerState, chosen: Chosen, rng: np.random.Generator) -> Recording:
    seconds, noise = chosen["seconds"], chosen["noise"]
    plan = HammerPlan(
        hits=chosen["hits"],
        seconds_per_hit=_HAMMER_SECONDS if seconds is None else seconds,
        sampling_rate_hz=chosen["rate"],
        sensors_x_m=spread_places_m(hanger, chosen["sensors"] or _SENSORS),
        hammer_x_m=chosen["hammer_x"],
        acceleration_noise_m_s2=_HAMMER_NOISE if noise is None else noise,
    )
    plan = replace(plan, peak_force_n=plan.peak_force_n * chosen["amplitude"])
    return hammer_test(
        hanger,
        state,
        plan,
        rng,
        effects=[_effect(text) for text in chosen["effects"]],
        conditions=_conditions(chosen),
    )


def _conditions(chosen: Chosen) -> Conditions:
    """Return the conditions of a recording; an unknown temperature is the reference."""
    shift_k = chosen["temperature_c"] - chosen["reference_c"]
    mass = _mass(chosen["added_mass"])
    return Conditions("", 0.0 if math.isnan(shift_k) else shift_k, chosen["amplitude"], mass)


def _listened(
    hanger: Hanger, state: HangerState, chosen: Chosen, rng: np.random.Generator
) -> Recording:
    if chosen["effects"] or chosen["added_mass"]:
        raise UsageError(
            "effects and a known mass are planted in hammer tests only.",
            remedy="Leave out --ambient.",
        )
    usual, seconds, noise = AmbientPlan(), chosen["seconds"], chosen["noise"]
    plan = AmbientPlan(
        seconds=usual.seconds if seconds is None else seconds,
        sampling_rate_hz=chosen["rate"],
        sensors_x_m=spread_places_m(hanger, chosen["sensors"] or _SENSORS),
        acceleration_noise_m_s2=usual.acceleration_noise_m_s2 if noise is None else noise,
    )
    return ambient_test(hanger, state, plan, rng)


def _effect(text: str) -> PlantedEffect:
    """Read `NAME:AT:param=value,...`; raises UsageError where it is not that."""
    name, _, rest = text.partition(":")
    at, _, pairs = rest.partition(":")
    try:
        values = dict(_pair(pair) for pair in pairs.split(","))
    except ValueError:
        raise UsageError(
            f"--effect {text!r} is not NAME:AT:param=value,...",
            remedy="Write --effect 'point_mass:everywhere:mass_kg=12,x_m=3.4'.",
        ) from None
    return PlantedEffect(name, at, values)


def _pair(text: str) -> tuple[str, float]:
    name, value = text.split("=")
    return name.strip(), float(value)


def _mass(text: str | None) -> AddedMass | None:
    """Read `KG:X` or `KG:X:RADIUS`; raises UsageError where it is neither."""
    if text is None:
        return None
    try:
        mass_kg, x_m, *radius_m = (float(part) for part in text.split(":", 2))
    except ValueError:
        raise UsageError(
            f"--added-mass {text!r} is not KG:X or KG:X:RADIUS.",
            remedy="Write --added-mass 25:3.6, or 25:3.6:0.08.",
        ) from None
    return AddedMass(mass_kg, x_m, *radius_m)
