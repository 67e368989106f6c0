"""Cases without a trace of their cause."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.errors import UsageError
from shm.models.effects import EFFECTS, Survey
from shm.modes_document import load_modes
from shm.simulate import HangerState, PlantedEffect
from shm.values import PLANES, Hanger
from tests.benchmarks.blind import case as one_case
from tests.benchmarks.blind.case import PLANS, Draft, Site, make_case, planted_effects
from tests.benchmarks.blind.layout import read_trial
from tests.benchmarks.blind.making import give_one_time, make_trial, pad, seal
from tests.benchmarks.blind.sealing import key_of
from tests.benchmarks.blind.truth import PlantedKind, TrueCase
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import Campaign, CampaignPlan, campaign_with_truth
from tests.worlds.simulated.effects.registry import PLANTED, UNLISTED, choices
from tests.worlds.simulated.reality import drawn_hanger

KINDS: tuple[PlantedKind, ...] = get_args(PlantedKind)


def draft_of(kind: PlantedKind, effects: tuple[str, ...] = ()) -> Draft:
    usual = ("loose_guide",) if kind == "unknown" else ("point_mass", "bending_stiffness")
    return Draft(f"c{KINDS.index(kind)}", kind, "two planes", 0.6, effects or usual)


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, TrueCase]]:
    """One case of each kind, with two planes, as a trial holds them."""
    folder = tmp_path_factory.mktemp("cases")
    seeds = np.random.SeedSequence(11).spawn(4)
    truths = {
        f"c{number}": make_case(folder / f"c{number}", draft_of(kind), seed)
        for number, (kind, seed) in enumerate(zip(KINDS, seeds, strict=True))
    }
    pad(folder / case for case in truths)
    give_one_time(folder)
    return folder, truths


def test_whatever_is_planted_files_have_the_same_names_sizes_and_times(
    cases: tuple[Path, dict[str, TrueCase]],
) -> None:
    folder, truths = cases
    seen = {
        tuple(
            (path.name, path.stat().st_size, path.stat().st_mtime)
            for path in sorted((folder / case).iterdir())
        )
        for case in truths
    }
    assert len(seen) == 1


def test_whatever_is_planted_modal_tests_have_the_same_fields(
    cases: tuple[Path, dict[str, TrueCase]],
) -> None:
    """Also null stands where it stands in all others: an unknown figure would be a trace."""
    folder, truths = cases
    forms = {
        json.dumps(form_of(json.loads((folder / case / "tests.modes.json").read_text())))
        for case in truths
    }
    assert len(forms) == 1


def form_of(node: object) -> object:
    """A document with its numbers taken out."""
    if isinstance(node, dict):
        return {key: form_of(value) for key, value in node.items()}
    if isinstance(node, list):
        return [form_of(each) for each in node]
    return "number" if isinstance(node, float) else node


def test_no_file_holds_a_cause_or_a_true_figure(
    cases: tuple[Path, dict[str, TrueCase]],
) -> None:
    folder, truths = cases
    names = [*EFFECTS, *UNLISTED, "planted", "seed_sequence"]
    for path in (each for each in folder.rglob("*") if each.is_file()):
        content, truth = path.read_bytes(), truths[path.parent.name]
        assert not [name for name in names if name.encode() in content]
        assert repr(truth.tension_n).encode() not in content


def test_the_key_says_what_was_planted_and_what_is_left_out(
    cases: tuple[Path, dict[str, TrueCase]],
) -> None:
    for truth in cases[1].values():
        names = tuple(each.name for each in truth.effects)
        assert len(names) == {"none": 0, "two": 2}.get(truth.kind, 1)
        wanted = {"none": 1, "unknown": 0}.get(truth.kind, len(names))
        assert len(truth.left_out) == wanted
        assert truth.kind in ("none", "unknown") or truth.left_out == names
        assert (truth.size == 0) == (truth.kind == "none")
        if truth.kind == "two":
            assert truth.size >= 8
        for each in truth.effects:
            assert each.size == pytest.approx(truth.size, rel=1e-6) or truth.kind == "two"


def test_sizes_lie_where_the_draft_says(cases: tuple[Path, dict[str, TrueCase]]) -> None:
    """Log-uniform from 1 to 1000: at 0.6 of the range 1000 to the power of 0.6."""
    one = next(t for t in cases[1].values() if t.kind == "one")
    assert one.size == pytest.approx(1000**0.6, rel=0.1)


def test_the_diagnosis_is_given_what_the_owner_knows(
    cases: tuple[Path, dict[str, TrueCase]],
) -> None:
    folder, truths = cases
    for case, truth in truths.items():
        hanger = load_hanger(folder / case / "hanger.toml")
        assert 6 <= hanger.length_m <= 15
        assert 0.6 < hanger.nominal_tension_n / truth.tension_n < 1.6
        told = json.loads((folder / case / "case.json").read_text())
        assert set(told) == {"schema", "baseline", "seed"}
    assert len(load_modes(folder / "c0" / "tests.modes.json")[0].modes) == 16


def test_neither_errors_of_sensors_without_shapes_nor_hardening_without_levels_are_planted() -> (
    None
):
    rng = np.random.default_rng(3)
    hanger, state = drawn_hanger(rng)
    site = Site(hanger, state, PLANS["two planes"])
    of_other_data = ("sensor_mass", "sensor_misalignment", "geometric_hardening")
    draft = draft_of("one", effects=(*of_other_data, "distributed_mass"))
    assert planted_effects(draft, site, rng)[0].name == "distributed_mass"


def test_a_case_whose_data_can_show_nothing_is_refused() -> None:
    rng = np.random.default_rng(3)
    hanger, state = drawn_hanger(rng)
    site = Site(hanger, state, PLANS["one plane"])
    with pytest.raises(UsageError, match="another seed"):
        planted_effects(draft_of("one", effects=("temperature_tension",)), site, rng)


def test_where_the_bar_as_it_was_made_buckles_other_effects_are_planted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[tuple[PlantedEffect, ...]] = []

    def buckles_once(
        hanger: Hanger,
        state: HangerState,
        effects: tuple[PlantedEffect, ...],
        plan: CampaignPlan,
        rng: np.random.Generator,
    ) -> Campaign:
        if not refused:
            refused.append(effects)
            raise UsageError("the compression buckles the hanger.")
        return campaign_with_truth(hanger, state, effects, plan, rng)

    monkeypatch.setattr("tests.benchmarks.blind.case.campaign_with_truth", buckles_once)
    truth = make_case(tmp_path / "case", draft_of("one"), np.random.SeedSequence(4))
    (planted,) = truth.effects
    ((before,),) = refused
    assert planted.values != before.values
    assert (tmp_path / "case" / "tests.modes.json").is_file()


def test_what_cannot_be_planted_has_an_infinite_size() -> None:
    hanger, state = drawn_hanger(np.random.default_rng(3))
    site = Site(hanger, state, PLANS["one plane"])
    assert site.size(()) == 0
    broken = PlantedEffect("point_mass", "everywhere", {"mass_kg": 5.0})
    assert site.size((broken,)) == math.inf


def test_every_effect_of_the_catalogue_can_be_planted_and_no_other_stands_in_it() -> None:
    """But for a load cell's: no simulated campaign reads a tension."""
    assert set(PLANTED) == set(EFFECTS) - {"load_scale"}
    assert not set(UNLISTED) & set(EFFECTS)


@pytest.mark.parametrize("name", PLANTED)
def test_an_effect_is_planted_wherever_the_diagnosis_looks_for_it_and_nowhere_else(
    name: str,
) -> None:
    """Both are told the same sensors and tests; a plane of its own counts as two at once."""
    places_m, tests = (1.5, 4.0), ("t1", "t2")
    survey = Survey(tests, PLANES, places_m, True, (5.0, 15.0), (0.5, 1.0), ())
    sought = {variant.at for variant in EFFECTS[name].variants(HANGER_3, survey)}
    planted = choices(name, places_m, tests)
    assert sorted(planted) == sorted({at for at in sought if "planes alike" not in at})


@pytest.mark.parametrize("name", ["effective_length", "sensor_misalignment", "timebase", "sag"])
def test_any_place_where_an_effect_may_act_is_drawn(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the sensors and tests of the case's own plan; one that cannot be is drawn anew."""
    hanger, state = drawn_hanger(np.random.default_rng(3))
    site, seen, refused = Site(hanger, state, PLANS["everything"]), set(), set()

    def scaled(size, hanger, state, effect, plan):  # type: ignore[no-untyped-def]
        refused.add(effect.at)
        return effect if rng.uniform() < 0.5 else None

    monkeypatch.setattr(one_case, "scaled_to", scaled)
    monkeypatch.setattr(Site, "size", lambda site, effects: 10.0)
    draft = replace(draft_of("one", effects=(name,)), share=1 / 3)  # a size of 10
    for seed in range(60):
        rng = np.random.default_rng(seed)
        (found,) = planted_effects(draft, site, rng)
        assert found.name == name
        seen.add(found.at)
    tests = [test.id for test in site.plan.tests(hanger)]
    assert seen == refused == set(choices(name, site.plan.places_m(hanger), tests))


@pytest.mark.slow
def test_the_same_seed_gives_the_same_cases_whatever_the_number_of_processes(
    tmp_path: Path,
) -> None:
    first, second = (make_trial(tmp_path / str(jobs), 2, seed=5, jobs=jobs) for jobs in (1, 2))
    assert first == second
    assert contents(tmp_path / "1") == contents(tmp_path / "2")


def contents(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_the_trial_says_nothing_of_its_seed_and_has_no_time_of_making(tmp_path: Path) -> None:
    truth = make_case(
        tmp_path / "trial" / "cases" / "c1", draft_of("one"), np.random.SeedSequence(5)
    )
    truth = replace(truth, case="c1")
    sha256 = seal(tmp_path / "trial", tmp_path / "trial.key.json", [truth], 5)
    trial = read_trial(tmp_path / "trial")
    assert (trial.cases, trial.key_sha256) == (("c1",), sha256)
    assert key_of(trial, tmp_path / "trial.key.json") == ((truth,), 5)
    document = json.loads((tmp_path / "trial" / "trial.json").read_text())
    assert set(document) == {"schema", "cases", "key_sha256"}
    salt = json.loads((tmp_path / "trial.key.json").read_text())["salt"]
    everything = [*(tmp_path / "trial").rglob("*"), tmp_path / "trial"]
    assert len({path.stat().st_mtime for path in everything}) == 1
    assert not [p for p in everything if p.is_file() and salt.encode() in p.read_bytes()]
