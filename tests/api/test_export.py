"""What other programs get: tables, files, and the DataTree that ArviZ reads."""

from __future__ import annotations

import importlib.util
import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
import xarray

import shm
from shm.documents import posterior_document
from shm.errors import BadInput, UsageError
from shm.models import MODELS


@pytest.fixture(scope="module")
def tree(
    hanger: shm.Hanger, posterior: shm.Posterior, test_of_711_kn: shm.ModalTest
) -> xarray.DataTree:
    return shm.export.datatree(posterior, [test_of_711_kn], hanger)


def test_datatree_holds_draws_likelihood_and_what_would_be_measured(
    tree: xarray.DataTree,
    posterior: shm.Posterior,
    hanger: shm.Hanger,
    test_of_711_kn: shm.ModalTest,
) -> None:
    group = tree["posterior"]
    assert set(group.data_vars) == {*posterior.names, "tension_n"}
    assert group["tension_n"].dims == ("chain", "draw")
    assert group["tension_n"].attrs["units"] == "N"
    np.testing.assert_array_equal(group["theta_L"].values[0], posterior.parameter("theta_L"))
    np.testing.assert_array_equal(tree["sample_stats"]["lp"].values[0], posterior.log_likelihood)
    assert tree.attrs["model"] == "beam1"
    assert tree.attrs["tests"] == ["t1"]
    # With the thesis's priors: those of the description know errors that measurements share.
    thesis = shm.update(test_of_711_kn, hanger, "beam1", samples=200, priors="thesis")
    each = shm.export.datatree(thesis, [test_of_711_kn], hanger)["log_likelihood"]
    total = each["frequency_hz"].sum("measurement").values[0]
    np.testing.assert_allclose(total, thesis.log_likelihood)
    observed = tree["observed_data"]["frequency_hz"]
    assert list(observed.values) == [mode.frequency_hz for mode in test_of_711_kn.modes]
    assert list(observed["order"].values) == [mode.order for mode in test_of_711_kn.modes]
    assert set(observed["test"].values) == {"t1"}
    first = tree["posterior_predictive"]["frequency_hz"].values[0, :, 0]
    row = posterior.predicted[0]
    sigma = np.hypot(posterior.parameter("sigma"), 0.001) * row.measured_hz
    assert first.mean() == pytest.approx(row.mean_hz, abs=4 * first.std() / np.sqrt(len(first)))
    assert first.std() == pytest.approx(np.hypot(row.sd_hz, np.sqrt((sigma**2).mean())), rel=0.2)


def test_datatree_of_no_or_other_tests(
    posterior: shm.Posterior, hanger: shm.Hanger, test_of_711_kn: shm.ModalTest
) -> None:
    alone = shm.export.datatree(posterior)
    assert set(alone.children) == {"posterior", "sample_stats", "observed_data", "constant_data"}
    longer = replace(hanger, length_m=11.0)
    with pytest.raises(BadInput, match="was not made from these tests"):
        shm.export.datatree(posterior, [test_of_711_kn], longer)
    with pytest.raises(UsageError, match="go together"):
        shm.export.datatree(posterior, [test_of_711_kn])


def test_test_that_counts_tenfold(hanger: shm.Hanger, test_of_711_kn: shm.ModalTest) -> None:
    """Posteriors of earlier versions say nothing of how often their one test counted."""
    copies = shm.update([test_of_711_kn] * 10, hanger, "beam1", samples=200, priors="thesis")
    first = copies.predicted[: len(test_of_711_kn.modes)]
    tenfold = replace(copies, tests=(test_of_711_kn.id,), predicted=first)
    each = shm.export.datatree(tenfold, [test_of_711_kn], hanger)["log_likelihood"]
    total = 10 * each["frequency_hz"].sum("measurement").values[0]
    np.testing.assert_allclose(total, tenfold.log_likelihood)


def test_arviz_reads_the_file_and_finds_the_same_mean(
    tmp_path: Path, hanger: shm.Hanger, posterior: shm.Posterior, test_of_711_kn: shm.ModalTest
) -> None:
    path = tmp_path / "hanger3.nc"
    shm.export.write(posterior, path, tests=[test_of_711_kn], hanger=hanger)
    assert [each.name for each in tmp_path.iterdir()] == ["hanger3.nc"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # ArviZ announces its next version at import
        import arviz
    read = arviz.from_netcdf(path)
    assert {"posterior", "log_likelihood", "posterior_predictive"} <= set(read.groups())
    summary = arviz.summary(read, var_names=["tension_n"], kind="stats", round_to="none")
    assert summary.loc["tension_n", "mean"] == pytest.approx(posterior.tension_n.mean())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of eight measurements one may weigh much
        assert np.isfinite(arviz.loo(read).elpd_loo)


def test_tables_and_files_hold_draws_and_modes(
    posterior: shm.Posterior, test_of_711_kn: shm.ModalTest, tmp_path: Path
) -> None:
    draws = shm.export.samples(posterior)
    assert list(draws.columns) == [*posterior.names, "tension_n", "log_likelihood"]
    assert draws["tension_n"].mean() == pytest.approx(posterior.tension_n.mean())
    modes = shm.export.modes([test_of_711_kn])
    assert len(modes) == 8
    assert modes["damping_ratio"].isna().all()
    assert str(modes["time"].dtype).endswith("UTC]")
    for suffix in ("csv", "npz", "json"):
        shm.export.write(posterior, tmp_path / f"a.{suffix}")
    tension = posterior.tension_n
    np.testing.assert_array_equal(pandas.read_csv(tmp_path / "a.csv")["tension_n"], tension)
    with np.load(tmp_path / "a.npz") as arrays:
        np.testing.assert_array_equal(arrays["tension_n"], tension)
    document = json.loads((tmp_path / "a.json").read_text())
    assert document["draws"]["tension_n"] == tension.tolist()
    assert document["samples"] == len(tension)
    with pytest.raises(UsageError, match=r"unknown suffix '.xls'. Use .csv, .nc, .json or .npz"):
        shm.export.write(posterior, tmp_path / "a.xls")
    with pytest.raises(UsageError, match="unknown format 'excel'"):
        shm.export.write(posterior, tmp_path / "a.csv", "excel")


@pytest.mark.parametrize("missing", ["xarray", "h5netcdf"])
def test_a_missing_library_is_named_with_what_to_install(
    tmp_path: Path, posterior: shm.Posterior, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == missing else found(name)
    )
    with pytest.raises(UsageError, match=rf"{missing} is not installed.*pip install shm\[export\]"):
        shm.export.write(posterior, tmp_path / "a.nc")
    assert list(tmp_path.iterdir()) == []


# A lateral spring along the hanger, whose name ends as a length does; an end spring of an effect.
SPRING = "beam1+intermediate_support@everywhere"
ENDS = "beam1+rotational_end_flexibility@deck_end.transverse"


@pytest.mark.parametrize(
    ("model", "units"),
    [
        ("beam2", {"theta_F": "1", "log10_k1": "log10(N m/rad)", "sigma": "1"}),
        (SPRING, {"log10_stiffness_n_m": "log10(N/m)", "x_m": "m", "section": "1"}),
        (ENDS, {"log10_k1": "log10(N m/rad)"}),
    ],
)
def test_datatree_units(
    hanger: shm.Hanger, test_of_711_kn: shm.ModalTest, model: str, units: dict[str, str]
) -> None:
    posterior = shm.update(test_of_711_kn, hanger, model, samples=50)
    group = shm.export.datatree(posterior)["posterior"]
    assert {name: group[name].attrs["units"] for name in units} == units
    parameters = posterior_document(posterior)["parameters"]
    assert {name: f"log10({each['unit']})" if "log10" in name else each["unit"]
            for name, each in parameters.items() if name in units} == units  # fmt: skip


def test_model_class_units() -> None:
    """Every parameter of every class has a unit; a solid's springs are forces on a length."""
    for name, model in MODELS.items():
        spring = "N/m" if name.startswith("solid") else "N m/rad"
        assert {each: model.units[each] for each in model.bounds} == {
            each: spring if each.startswith("log10_k") else "1" for each in model.bounds
        }
