"""Where the numbers of a report come from: files, checksums, settings, classes, versions."""

from __future__ import annotations

import math
from collections.abc import Mapping

from shm.report import words
from shm.report.content import HangerReport
from shm.report.paper import Table
from shm.settings import TABLE
from shm.values import ModalTest

_LINEAGE = {
    "file_name": "file of the latest test",
    "file_sha256": "SHA-256 of that file",
    "received": "received",
    "input_sha256": "SHA-256 of the identification's input",
    "settings_sha256": "SHA-256 of its settings",
    "version": "identified by shm version",
    "baseline": "baseline",
    "software": "computed on",
}


def origin(data: HangerReport) -> Table:
    posterior, test = data.posterior, data.latest
    facts = {
        "test": f"{test.id}, {words.moment(test.time)}",
        "temperature": words.temperature(test.temperature_c),
        "hit level over reference level": words.plain(test.amplitude, absent="not recorded"),
        "added mass": added_mass(test),
        "modes identified": f"{len(test.modes)}",
        "model class": words.model_class(posterior.model),
        "tests in this posterior": ", ".join(posterior.tests),
        "posterior samples": f"{len(posterior.samples)} (effective "
        f"{words.number(posterior.effective_sample_size, '.0f')})",
        "R-hat (1 is settled)": words.number(posterior.r_hat, ".3f"),
        "model evaluations": f"{posterior.evaluations}",
        "random seed": f"{posterior.seed}",
        "computing time": _seconds(posterior.seconds),
        **lineage(data.lineage),
        "report made": f"{words.moment(data.generated_at)} by shm version {data.version}",
    }
    return Table("Where these numbers come from", ("what", "value"), tuple(facts.items()))


def _seconds(seconds: float) -> str:
    return f"{seconds:.1f} s" if math.isfinite(seconds) else "not known"


def lineage(told: Mapping[str, str]) -> dict[str, str]:
    """What a result was made from, its keys in words."""
    return {_LINEAGE.get(key, words.quantity(key)): value for key, value in told.items()}


def added_mass(test: ModalTest) -> str:
    mass = test.added_mass
    return f"{mass.mass_kg:g} kg at {mass.x_m:g} m from the deck end" if mass else "none"


def settings(told: Mapping[str, str]) -> Table:
    """The settings that decide the numbers, each with its unit; empty where nobody says."""
    helps = {row.name: row.help for row in TABLE}
    return Table(
        "Settings in force",
        ("setting", "value", "what it is"),
        tuple((name, _spaced(value), helps.get(name, "")) for name, value in told.items()),
        note="Of identification, updating and watch, as they stand now: given, without interval.",
    )


def _spaced(value: str) -> str:
    """`beam1,beam2` as a list that folds."""
    return ", ".join(value.split(","))
