"""Values in a researcher's hand: a line, a summary, tables for pandas, draws for ArviZ."""

from __future__ import annotations

import math
import re
import sys
from dataclasses import replace

import pytest

import shm
from shm.errors import UsageError
from shm.report.diagnosis_summary import write_lead
from shm.report.formatting import Interval, tension
from shm.values.rounding import force_unit
from shm.watch.frequency_watch import measured_levels
from tests.helpers.diagnoses import a_diagnosis


def test_repr_rounds_as_report(posterior: shm.Posterior, test_of_711_kn: shm.ModalTest) -> None:
    stated = tension(Interval.of_samples(posterior.tension_n), force_unit(711e3))
    told = stated.replace("90 % interval", "90 % credible interval")
    told = re.sub(r" kN \((.*interval)", r" kN (\1", told)
    assert repr(posterior) == f"<Posterior of hanger 3: beam1, {told}>"
    assert re.fullmatch(
        r"<ModalTest t1 of hanger 3: 8 modes, \d+\.\d{3} to \d+\.\d{3} Hz>", repr(test_of_711_kn)
    )
    read = replace(test_of_711_kn, tension_read_n=700e3, tension_read_sd_n=10e3)
    assert repr(read).endswith("read 700 kN (90 % credible interval 684 to 716 kN)>")
    assert re.fullmatch(
        r"<Diagnosis of hanger 3: explained: point mass, .* kN \(90 % credible .* kN\)>",
        repr(a_diagnosis()),
    )


def test_line_and_summary_say_what_is_not_known() -> None:
    unknown = replace(a_diagnosis().tension_after_n, mean=math.nan)
    assert "tension not known" in repr(replace(a_diagnosis(), tension_after_n=unknown))
    alone = shm.ModalTest("a", ())
    assert repr(alone) == "<ModalTest a: 0 modes>"
    assert "time not recorded, temperature not recorded" in alone.summary()


def test_identification_shows_its_modes_and_doubts(identified: shm.Identification) -> None:
    warned = replace(
        identified.quality[0], verdict="warning", found="few hits", remedy="Hit it again."
    )
    found = replace(identified, quality=(warned,))
    assert repr(found) == f"<Identification of {found.test!r}>"
    assert found.summary().startswith(found.test.summary())
    assert found.summary().endswith(f"{warned.name}, warning: few hits. Hit it again.")
    assert "<table" in found._repr_html_()


def test_summary_has_report_words(posterior: shm.Posterior, test_of_711_kn: shm.ModalTest) -> None:
    doubted = replace(posterior, description_off_sd=5.0)
    diagnosis = a_diagnosis()
    for value in (posterior, test_of_711_kn, diagnosis):
        text = value.summary()
        assert not re.search(r"\bnan\b|None|\binf\b|<|[ ]$", text, re.MULTILINE)
    assert doubted.faults[0] in " ".join(doubted.summary().split())
    assert write_lead(diagnosis) in " ".join(diagnosis.summary().split())
    assert len(test_of_711_kn.summary().splitlines()) == 3 + len(test_of_711_kn.modes)
    doubted = replace(posterior, description_off_sd=5.0)
    # Of classes it leads with caveats and the tension.
    text = " ".join(shm.Selection((doubted, posterior), (0.6, 0.4)).summary().split())
    caveat, tension, table = (
        text.index(each)
        for each in (doubted.faults[0], "Tension 69", "class probability log evidence")
    )
    assert caveat < tension < table
    html = shm.Selection((posterior,), (1.0,))._repr_html_()
    assert html.index("credible interval") < html.index("<table>")


def test_rows_of_dataframes(posterior: shm.Posterior, test_of_711_kn: shm.ModalTest) -> None:
    assert list(posterior.to_dataframe()["tension_n"]) == list(posterior.tension_n)
    modes = test_of_711_kn.to_dataframe()
    assert list(modes["frequency_hz"]) == [mode.frequency_hz for mode in test_of_711_kn.modes]
    diagnosis = a_diagnosis()
    causes = diagnosis.to_dataframe().set_index("cause")
    assert list(causes.index) == [cause.effect for cause in diagnosis.causes]
    assert causes.loc["point_mass", "mass_kg"] == 12.0
    assert causes.loc["point_mass", "sd_mass_kg"] == 0.5
    assert math.isnan(causes.loc["temperature_tension", "mass_kg"])
    none = replace(diagnosis, causes=()).to_dataframe()
    assert len(none) == 0
    assert "probability" in none


def test_arviz_or_install(posterior: shm.Posterior, monkeypatch: pytest.MonkeyPatch) -> None:
    data = posterior.to_arviz()
    import arviz

    found = arviz.summary(data, var_names=["tension_n"], kind="stats", round_to="none")
    assert found.loc["tension_n", "mean"] == pytest.approx(posterior.tension_n.mean())
    assert data["posterior"]["tension_n"].attrs["units"] == "N"
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(UsageError, match=r"arviz is not installed.*pip install 'shm\[arviz\]'"):
        posterior.to_arviz()


def test_posterior_of_structure_shows(test_of_711_kn: shm.ModalTest) -> None:
    found = measured_levels([test_of_711_kn], seed=1)
    assert repr(found) == "<Posterior of hanger 3: 8 measured frequencies, no model>"
    html = found._repr_html_()
    assert "measured frequencies without a model" in html
    assert f"{test_of_711_kn.modes[0].frequency_hz:.3f}" in html
