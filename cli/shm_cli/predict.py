"""`shm predict`: the frequencies of one parameter set, or of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rich_click as click

from shm.errors import UsageError
from shm.models import THESIS, Model, build
from shm.values import PLANES, FloatArray
from shm_cli import completion, flags
from shm_cli.common import one_hanger, progress_bar, show, show_rows

_MOST_POINTS = 10_000  # technical: a table that a person can still open, in seconds


@click.command()
@click.argument("model", shell_complete=completion.models)
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="A parameter.")
@click.option("--sweep", metavar="NAME=FROM:TO:N", help="A parameter over a range.")
@click.option("--modes", type=click.IntRange(1, 100), default=6)
@flags.hanger()
@flags.hanger_file
@flags.json
def command(
    model: str,
    settings: tuple[str, ...],
    sweep: str | None,
    modes: int,
    hanger_id: int | None,
    hanger_file: Path | None,
) -> None:
    """Predict the frequencies of a model class.

    theta_F is tension over nominal tension, theta_L effective over nominal length (both 1 unless
    set), log10_k1 to log10_k4 the end springs: N m/rad for beams (k1, k3 transverse; k2, k4
    longitudinal), N/m per node for solids. A solid class is solved in full, without its reduced
    basis: a few tenths of a second a parameter set. A beam is the bare bar: fittings, kind of ends,
    inclination and how it was taped count in update and select.

    \b
    Example: shm predict beam1 --hanger-file H.toml --set theta_F=1 --set theta_L=0.97
    Example: shm predict beam1 --hanger-file H.toml --sweep theta_F=0.5:2:50
    """
    # The thesis's for its parameters alone: nobody asked for its reading of the description.
    chosen = build(model, one_hanger(hanger_file, hanger_id), THESIS).as_it_hangs()
    nominal = {name: 1.0 for name in chosen.parameter_names if name.startswith("theta_")}
    values = nominal | dict(_pair(setting) for setting in settings)
    if sweep is None:
        _show_one(chosen, values, modes)
    else:
        name, points = _range(sweep)
        _show_sweep(chosen, values, name, points, _swept(chosen, values, name, points, modes))


def _show_one(model: Model, values: dict[str, float], modes: int) -> None:
    frequencies = _solved(model, model.pack(values), modes)
    if flags.wants_json():
        show({"model": model.name, "parameters": values, "frequencies": _rows(frequencies)})
        return
    lines = [
        (str(order), *(f"{frequency:.4f}" for frequency in row))
        for order, row in enumerate(frequencies.T, start=1)
    ]
    show_rows(model.title, ("mode", *(f"{plane} (Hz)" for plane in PLANES)), lines)


def _swept(
    model: Model, values: dict[str, float], name: str, points: FloatArray, modes: int
) -> FloatArray:
    """Return frequencies in Hz, points by planes by modes."""
    theta = np.array([model.pack({**values, name: float(point)}) for point in points])
    with progress_bar() as progress:
        rows_hz = []
        for done, row in enumerate(theta, start=1):
            rows_hz.append(_solved(model, row, modes))
            progress(model.name, done / len(theta))
    return np.array(rows_hz)


def _show_sweep(
    model: Model,
    values: dict[str, float],
    name: str,
    points: FloatArray,
    frequencies: FloatArray,
) -> None:
    if flags.wants_json():
        rows: list[dict[str, Any]] = [
            {name: float(point), "frequencies": _rows(row)}
            for point, row in zip(points, frequencies, strict=True)
        ]
        show({"model": model.name, "parameters": values, "sweep": name, "points": rows}, "sweep")
        return
    orders = range(1, frequencies.shape[2] + 1)
    heads = [f"{plane[0].upper()}{order}" for plane in PLANES for order in orders]
    lines = [
        (f"{point:g}", *(f"{frequency:.3f}" for frequency in row.ravel()))
        for point, row in zip(points, frequencies, strict=True)
    ]
    title = f"{model.title}: frequencies in Hz (T transverse, L longitudinal)"
    show_rows(title, (name, *heads), lines)


def _solved(model: Model, theta: FloatArray, modes: int) -> FloatArray:
    """Return frequencies in Hz, planes by modes; raises UsageError where there are none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found: FloatArray = model.reference_frequencies_hz(theta[None], modes)[0]
    of = dict(zip(model.parameter_names, theta, strict=True))
    if not np.isfinite(found[:, 0]).all() or of.get("theta_L", 1.0) <= 0:
        given = ", ".join(f"{name}={value:g}" for name, value in of.items())
        raise UsageError(
            f"model class {model.name} has no frequencies at {given}.",
            remedy="Give positive numbers: theta_F is a multiple of the nominal tension.",
        )
    return found


def _rows(frequencies: FloatArray) -> list[dict[str, object]]:
    return [
        {"plane": plane, "order": order, "frequency_hz": float(frequency)}
        for plane, row in zip(PLANES, frequencies, strict=True)
        for order, frequency in enumerate(row, start=1)
    ]


def _pair(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise UsageError(
            f"--set {text!r} is not NAME=VALUE.", remedy="Write --set theta_F=1.0, say."
        ) from None


def _range(text: str) -> tuple[str, FloatArray]:
    name, _, limits = text.partition("=")
    try:
        start, stop, count = limits.split(":")
        if not 1 <= int(count) <= _MOST_POINTS:
            raise ValueError(count)
        return name.strip(), np.linspace(float(start), float(stop), int(count))
    except ValueError:
        raise UsageError(
            f"--sweep {text!r} is not NAME=FROM:TO:N, with N from 1 to {_MOST_POINTS}.",
            remedy="Write --sweep theta_F=0.5:2:16, say.",
        ) from None
