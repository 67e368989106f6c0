"""`shm acquire`: a hammer test from an audio interface, each hit checked while it is made."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rich_click as click

from shm.errors import BadInput, UsageError
from shm.pipeline import utc_now
from shm.read import write
from shm.read.bundles import bundle
from shm.report.formatting import counted
from shm.values import PLANES, Channel, Recording
from shm_cli import flags
from shm_cli.common import answer, one_hanger

if TYPE_CHECKING:
    from shm.acquire import Acquired

_SIMULATED = "simulated"


def _channel_of(text: str, name: str, option: str) -> Channel:
    """Read `X:PLANE:FULL_SCALE`; raises UsageError where it is no such text."""
    try:
        x_m, plane, full_scale = text.split(":")
        if plane not in PLANES or not (float(x_m) > 0 and 0 < float(full_scale) < np.inf):
            raise ValueError
    except ValueError:
        raise UsageError(
            f"{option} {text!r} is not X:PLANE:FULL_SCALE.",
            remedy=f"Write {option} 2.52:transverse:981, say: metres from the deck end, "
            f"{' or '.join(PLANES)}, and what full scale of the interface is worth in N or m/s2.",
        ) from None
    quantity: Any = "force" if name == "force" else "acceleration"
    return Channel(name, quantity, np.empty(0), plane, float(x_m), float(full_scale))


@click.command()
@click.option("--device", required=True, help="Name or number of an interface, or 'simulated'.")
@click.option(
    "--hammer",
    required=True,
    metavar="X:PLANE:N",
    help="First channel: place in m, direction, N at full scale.",
)
@click.option(
    "--sensor",
    "sensors",
    required=True,
    multiple=True,
    metavar="X:PLANE:M_S2",
    help="Next channel: place in m, direction, m/s2 at full scale; may be repeated.",
)
@click.option("--seconds", type=click.FloatRange(1, 600), default=20.0, help="Ring-down of a hit.")
@click.option("--rate", "rate_hz", type=click.FloatRange(100), default=1000.0, help="Samples/s.")
@click.option("--least-hits", type=click.IntRange(1, 99), default=3, help="Before it may stop.")
@click.option("--most-hits", type=click.IntRange(1, 99), default=10, help="It stops after these.")
@click.option(
    "--precision",
    type=click.FloatRange(1e-5, 0.1),
    default=1e-3,
    help="Enough: standard deviation of the worst mode over its frequency.",
)
@click.option(
    "--temperature-c", type=float, default=np.nan, show_default=False, help="Unknown if left out."
)
@click.option(
    "--out", required=True, type=flags.NewFile(), metavar="TEST.zip", help="Write the test here."
)
@flags.hanger()
@flags.hanger_file
@flags.seed
@flags.json
def command(
    device: str,
    hammer: str,
    sensors: tuple[str, ...],
    temperature_c: float,
    out: Path,
    hanger_id: int | None,
    hanger_file: Path | None,
    seed: int,
    **chosen: Any,
) -> None:
    """Guide a hammer test: levels, when to hit, and which hits count.

    A double hit or an overload is reported at once. It stops when the modes are good enough, and
    writes one recording for each hit into a .zip, which `shm ingest` takes as one test.

    \b
    Example: shm acquire --device 0 --hanger 3 --hammer 2:transverse:5e3 --sensor 3:transverse:981 --out t.zip
    """  # noqa: E501
    from shm.acquire import AcquireOptions, SimulatedDevice, SoundCard, acquire

    if out.suffix.lower() != ".zip":
        raise UsageError(f"{out.name} is no .zip.", remedy="Write --out TEST.zip.")
    hanger = one_hanger(hanger_file, hanger_id)
    named = ((text, f"acc_{n}", "--sensor") for n, text in enumerate(sensors, start=1))
    channels = tuple(_channel_of(*each) for each in ((hammer, "force", "--hammer"), *named))
    if device == _SIMULATED:
        rng = np.random.default_rng(seed)
        hits = chosen["most_hits"] + 2
        source: Any = SimulatedDevice(
            hanger,
            channels,
            rng,
            hits=hits,
            double=(2,),
            overload=(3,),
            seconds=chosen["seconds"] + 5.0,
        )
    else:
        source = SoundCard(device, len(channels))
    try:
        tell = partial(click.echo, err=True)
        options = AcquireOptions(**chosen)
        got = acquire(source, channels, tell, options, hanger=hanger, clock=utc_now)
    finally:
        source.close()
    _write([replace(each, temperature_c=temperature_c) for each in got.hits], out)
    if got.lost:
        many = counted(len(got.hits), "hit")
        stored_words = f"{many} {'is' if len(got.hits) == 1 else 'are'} kept in {out}"
        remedy = "Check its cable, and repeat the test."
        raise BadInput(
            f"{got.lost} {stored_words if got.hits else 'No hit was recorded'}.", remedy=remedy
        )
    answer(*_answer(got, out))


def _write(hits: list[Recording], out: Path) -> None:
    """Write one CSV for each hit into the archive; without a hit nothing."""
    if not hits:
        return
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"hit{number:02}.csv" for number in range(1, len(hits) + 1)]
        for hit, path in zip(hits, paths, strict=True):
            write(hit, path)
        bundle(paths, out)


def _answer(got: Acquired, out: Path) -> tuple[dict[str, object], str]:
    modes = got.found.test.modes if got.found else ()
    document = {
        "schema": "shm.acquire/1",
        "file": str(out),
        "hits": len(got.hits),
        "rejected": list(got.rejected),
        "is_enough": not got.missing,
        "missing": got.missing,
        "modes": [
            {"plane": each.plane, "order": each.order, "frequency_hz": each.frequency_hz,
             "frequency_sd_hz": each.frequency_sd_hz}
            for each in modes
        ],
    }  # fmt: skip
    state = f"not good enough: {got.missing}" if got.missing else "good enough"
    text = f"{len(got.hits)} hits, {len(modes)} modes, {state}. Take it in: shm ingest {out}"
    warned = [e for e in (got.found.quality if got.found else ()) if e.verdict == "warning"]
    text = "\n".join((text, *(f"{e.name}: {e.found}. {e.remedy}" for e in warned)))
    return document, text
