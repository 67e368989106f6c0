"""`shm simulate`: hammer tests of a hanger whose truth is chosen."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import rich_click as click

from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm_cli.common import (
    counting_bar,
    hanger_file_option,
    hanger_option,
    one_hanger,
    seed_option,
)

_FIRST = datetime(2026, 1, 5, 10, tzinfo=UTC)
_SPRING = "End spring in N m/rad; clamped if left out."


@click.command()
@hanger_option()
@hanger_file_option
@click.option("--tension-n", type=float, help="Planted tension; the nominal one if left out.")
@click.option("--k1", type=float, default=math.inf, help=f"Transverse, deck end. {_SPRING}")
@click.option("--k2", type=float, default=math.inf, help=f"Longitudinal, deck end. {_SPRING}")
@click.option("--k3", type=float, default=math.inf, help=f"Transverse, arch end. {_SPRING}")
@click.option("--k4", type=float, default=math.inf, help=f"Longitudinal, arch end. {_SPRING}")
@click.option("--damping", type=float, default=0.001, show_default=True, help="Damping ratio.")
@click.option("--noise", type=float, default=0.02, show_default=True, help="In m/s^2.")
@click.option("--hits", type=click.IntRange(1, 50), default=5, show_default=True)
@click.option("--seconds", type=float, default=20.0, show_default=True, help="Seconds a hit.")
@click.option("--tests", type=click.IntRange(1, 10_000), default=1, show_default=True)
@click.option("--temperature-c", type=float, default=math.nan, help="Unknown if left out.")
@click.option("--first", type=click.DateTime(), help="Time of the first test; then weekly.")
@click.option(
    "--format", "form", type=click.Choice(["csv", "uff"]), default="csv", show_default=True
)
@click.option(
    "--out", required=True, type=click.Path(file_okay=False, path_type=Path), metavar="DIR"
)
@seed_option
@click.pass_context
def command(
    ctx: click.Context,
    hanger_id: int | None,
    hanger_file: Path | None,
    tension_n: float | None,
    k1: float,
    k2: float,
    k3: float,
    k4: float,
    damping: float,
    noise: float,
    hits: int,
    seconds: float,
    tests: int,
    temperature_c: float,
    first: datetime | None,
    form: str,
    out: Path,
    seed: int,
) -> None:
    """Hammer tests of a hanger whose truth you choose.

    Beam finite elements are hit in the time domain; two biaxial accelerometers record.

    \b
    Example: shm simulate --hanger-file H.toml --tension-n 650e3 --k1 1e7 --k3 1e7 --out tests
    """
    hanger = one_hanger(ctx, hanger_file, hanger_id)
    tension = hanger.nominal_tension_n if tension_n is None else tension_n
    state = HangerState(tension, k1, k2, k3, k4, damping_ratio=damping)
    plan = HammerPlan(hits=hits, seconds_per_hit=seconds, acceleration_noise_m_s2=noise)
    start = first.replace(tzinfo=UTC) if first else _FIRST
    out.mkdir(parents=True, exist_ok=True)
    with counting_bar() as bar:
        for week in bar.track(range(tests), description="simulating"):
            rng = np.random.default_rng([seed, week])
            time = start + timedelta(weeks=week)
            name = f"hanger{hanger.id}_{time:%Y%m%dT%H%M%S}.{form}"
            recording = hammer_test(
                hanger, state, plan, rng, time=time, temperature_c=temperature_c, source=name
            )
            write(recording, out / name)
            click.echo(out / name)
