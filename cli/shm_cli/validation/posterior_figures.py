"""Figures 5.1 to 5.37 of the thesis: ours of the same class, data and parameters.

The data are table 1.1, counted ten times (docs/trials/validation.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime

import numpy as np

from shm import __version__
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.modes_document import load_modes
from shm.report.contents import HangerReport
from shm.report.figures import hanger_frequencies, parameter_pairs
from shm.values import Hanger, Posterior, Summary
from shm_cli import thesis
from shm_cli.validation.figure import Figure

Tell = Callable[[str, float], None]
# As in the thesis, chapter 5: data and N_D; technical: draws enough for a marginal.
_PRINTING, _REPEAT, _SAMPLES = "table 1.1", 10, 2000

# Class and parameters by figure: one or more alone, "a/b" a against b, "" the frequencies. Of 5.24
# and 5.31 the captions name a parameter twice, of 5.28 a kx that the class has not: what is left
# stands for it. 5.32 is of class 2 by its text, not of class 1.
_ALL = """
5.1 beam1 L F sigma | 5.2 beam1 L/F | 5.3 beam1
5.4 beam2 F L k1 k2 | 5.5 beam2 k3 k4 sigma | 5.6 beam2 L/F | 5.7 beam2 k1/F | 5.8 beam2 k1/L
5.9 beam2 k2/F | 5.10 beam2 k2/L | 5.11 beam2 k2/k1 | 5.12 beam2 k3/F | 5.13 beam2 k3/L
5.14 beam2 k3/k1 | 5.15 beam2 k4/F | 5.16 beam2 k4/L | 5.17 beam2 k4/k1 | 5.18 beam2
5.19 solid0 F sigma | 5.20 solid0 sigma/F | 5.21 solid0
5.22 solid1 F k1 k2 k3 | 5.23 solid1 k4 kly krx kry | 5.24 solid1 klx sigma | 5.25 solid1 k1/F
5.26 solid1 k3/k2 | 5.27 solid1 k4/k3 | 5.28 solid1 klx/F | 5.29 solid1
5.30 solid2 F k1 k2 k3 | 5.31 solid2 k4 sigma | 5.32 solid2 k4/k1 | 5.33 solid2 k1/F
5.34 solid2 k2/F | 5.35 solid2 k3/F | 5.36 solid2 k4/F | 5.37 solid2
"""
FIGURES = {
    number: (model, tuple(names))
    for each in _ALL.replace("\n", "|").split("|")
    if each.strip()
    for number, model, *names in [each.split()]
}


def shown(hanger: Hanger, tell: Tell, number: str) -> Figure:
    """One of `FIGURES`: the class is updated, then drawn."""
    model, names = FIGURES[number]
    posterior = _posterior(hanger, model, tell)
    if not names:
        return _frequencies(hanger, posterior, number)
    alone = tuple(_name(part) for part in "/".join(names).split("/"))
    heads = ("parameter", "most probable", "mean", "sd", "5 %", "median", "95 %")
    cells, document = [], {}
    for name in alone:
        told = Summary.of(posterior.parameter(name))
        best = float(posterior.most_probable[posterior.names.index(name)])
        values = (best, told.mean, told.sd, told.q05, told.q50, told.q95)
        cells.append((name, *(f"{value:.4g}" for value in values)))
        document[name] = dict(zip(heads[1:], values, strict=True))
    if "/" not in names[0]:
        drawn = parameter_pairs.marginals(posterior, alone)
        return Figure(_title(number, "alone"), heads, cells, _DATA, document, drawn)
    pair = np.array([posterior.parameter(name) for name in alone])
    statement = f"{_DATA} Correlation {np.corrcoef(pair)[0, 1]:+.2f}. Colours: posterior density."
    drawn = parameter_pairs.pair(posterior, *alone)
    return Figure(_title(number, "against each other"), heads, cells, statement, document, drawn)


_DATA = f"Data: {_PRINTING}, N_D = {_REPEAT}; priors of the thesis."


def _title(number: str, what: str) -> str:
    return f"Figure {number}: parameters of class {FIGURES[number][0]} {what}"


def _name(short: str) -> str:
    known = {"F": "theta_F", "L": "theta_L", "sigma": "sigma"}
    return known.get(short, f"log10_{short}")


def _posterior(hanger: Hanger, model: str, tell: Tell) -> Posterior:
    options = UpdateOptions(samples=_SAMPLES, repeat=_REPEAT)
    tests = load_modes(thesis.PRINTINGS[_PRINTING])
    return update(tests, build(model, hanger, THESIS), options, tell)


def _frequencies(hanger: Hanger, posterior: Posterior, number: str) -> Figure:
    tests = tuple(load_modes(thesis.PRINTINGS[_PRINTING]))
    report = HangerReport("", hanger, tests, posterior, datetime.now(UTC), __version__)
    rows = posterior.predicted
    cells = [
        (
            each.plane, str(each.order), f"{each.measured_hz:.2f}",
            f"{each.mean_hz:.3f} ± {each.sd_hz:.3f}", f"{each.mean_hz / each.measured_hz:.4f}",
        )
        for each in rows
    ]  # fmt: skip
    heads = ("plane", "mode", "measured (Hz)", "predicted (Hz)", "over measured")
    drawn = hanger_frequencies.specify(report)
    title = f"Figure {number}: uncertainty propagated to the frequencies of {posterior.model}"
    return Figure(title, heads, cells, _DATA, [asdict(each) for each in rows], drawn)
