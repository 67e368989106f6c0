"""Figures for a notebook are the report's, and values show themselves there."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure

import shm
from shm import notebook
from shm.errors import NothingThere, UsageError
from shm.inference import UpdateOptions
from shm.models import build
from tests.helpers import quick_update
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.gap_checks import a_check

UNITS = {
    "tension": "tension (kN)",
    "trend": "tension (kN)",
    "frequencies": "predicted / measured frequency",
    "frequency_response": "accelerance (m/s²/N)",
    "stabilisation": "frequency (Hz)",
    "shapes": "position from the deck end (m)",
    "stiffness": "stiffness (MN m/rad)",
    "gap": "order of the mode",
    "causes": "probability",
    "recording": "time (s)",
    "gap_check": "size, from the weakest to the strongest of its prior range",
}


@pytest.fixture(scope="module")
def drawn(
    hanger: shm.Hanger,
    posterior: shm.Posterior,
    test_of_711_kn: shm.ModalTest,
    identified: shm.Identification,
    recording: shm.Recording,
) -> dict[str, Figure]:
    dated = replace(test_of_711_kn, time=datetime(2026, 5, 1, tzinfo=UTC))
    sprung = quick_update.update([dated], build("beam2", hanger), UpdateOptions())
    return {
        "tension": shm.plot.tension(posterior, hanger),
        "trend": shm.plot.trend([posterior], [dated], hanger),
        "frequencies": shm.plot.frequencies(posterior, test_of_711_kn, hanger),
        "frequency_response": shm.plot.frequency_response(identified, hanger),
        "stabilisation": shm.plot.stabilisation(identified),
        "shapes": shm.plot.shapes(identified, hanger),
        "stiffness": shm.plot.stiffness([sprung], [dated], hanger),
        "gap": shm.plot.gap(a_diagnosis(), hanger),
        "causes": shm.plot.causes(a_diagnosis(), hanger),
        "recording": recording.plot(),
        "gap_check": shm.plot.gap_check(a_check()),
    }


def test_every_figure_of_a_notebook_is_drawn_and_says_what_it_lacks(
    hanger: shm.Hanger, posterior: shm.Posterior, test_of_711_kn: shm.ModalTest
) -> None:
    offered = {
        name
        for name, each in vars(shm.plot).items()
        if inspect.isfunction(each) and each.__module__ == "shm.plot" and name[0] != "_"
    }
    assert offered == set(UNITS)
    with pytest.raises(NothingThere, match="'Trend of the tension'"):
        shm.plot.trend([posterior], [test_of_711_kn], hanger)  # no test has a time
    with pytest.raises(UsageError, match="1 posteriors and 0 tests"):
        shm.plot.trend([posterior], [], hanger)


class Formatter:
    """What IPython's formatters do with a name of a class."""

    def __init__(self) -> None:
        self.shown: dict[tuple[str, str], Callable[..., object]] = {}

    def for_type_by_name(self, home: str, kind: str, show: Callable[..., object]) -> object:
        before = self.shown.get((home, kind))
        self.shown[home, kind] = show
        return before


def test_a_notebook_shows_values(
    hanger: shm.Hanger, posterior: shm.Posterior, test_of_711_kn: shm.ModalTest
) -> None:
    choice = shm.Selection((posterior,), (1.0,))
    for value in (hanger, posterior, choice, test_of_711_kn, a_diagnosis(), a_check()):
        html = value._repr_html_()
        assert re.search(r"<caption>.*hanger 3", html, re.IGNORECASE)
        assert not re.search(r"\bnan\b|None|\binf\b", html)
    assert re.search(r"Tension \d+ kN", posterior._repr_html_())


def test_notebook_shows_figures_once(drawn: dict[str, Figure]) -> None:
    formatters = {"image/png": Formatter()}
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters=formatters))
    notebook.load_ipython_extension(shell)
    png = formatters["image/png"].shown["matplotlib.figure", "Figure"](drawn["tension"])
    assert bytes(png).startswith(b"\x89PNG")  # type: ignore[call-overload]
    own = formatters["image/png"].shown["matplotlib.figure", "Figure"] = lambda figure: b""
    notebook.load_ipython_extension(shell)
    assert formatters["image/png"].shown["matplotlib.figure", "Figure"] is own
