"""Tables that several kinds of report have: quality checks with what the whole deserves, origins.

Where numbers come from: files, checksums, settings, classes, versions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from shm.report import formatting
from shm.report.formatting import Interval
from shm.report.paper import Table, fold_improbable
from shm.report.sizes import size_of
from shm.settings import TABLE
from shm.values import ModalTest, Posterior, QualityCheck, Selection, Verdict
from shm.values.modes import FIRST_ORDERS, NUMBERING
from shm.values.rounding import force_unit

SYMBOLS: dict[Verdict, str] = {"good": "✓", "warning": "!", "refused": "✗", "unknown": "?"}
_GRAVEST: tuple[Verdict, ...] = ("refused", "warning", "unknown", "good")


def verdict_label(verdict: Verdict) -> str:
    """Return `✓ good`."""
    return f"{SYMBOLS[verdict]} {verdict}"


def overall(checks: Sequence[QualityCheck]) -> Verdict:
    """Return the gravest of the verdicts; one good check outweighs any number that say nothing."""
    given = {check.verdict for check in checks}
    if given <= {"unknown"}:
        return "unknown"
    return next(verdict for verdict in _GRAVEST if verdict in given - {"unknown"})


_HEADLINES: dict[Verdict, str] = {
    "good": "Good",
    "warning": "Use with care",
    "refused": "Do not use",
    "unknown": "Not checked",
}


def headline(checks: Sequence[QualityCheck]) -> str:
    """Return the overall verdict and the lowest modes that are missing: `Use with care: ...`."""
    grave = (FIRST_ORDERS, "warning"), (NUMBERING, "refused")
    lost = [c.found for c in checks if (c.name, c.verdict) in grave]
    return ": ".join([_HEADLINES[overall(checks)], *lost])


def with_unit(value: float, unit: str) -> str:
    """Return a figure with its unit as one reads it, `not known` where it is NaN."""
    known = math.isfinite(value)
    return f"{formatting.plain(value)} {unit}".rstrip() if known else formatting.plain(value)


def quality_table(checks: Sequence[QualityCheck], title: str = "Quality") -> Table:
    """Return the checks in order: verdict by symbol and word, figure and limit, action."""
    return Table(
        title,
        ("check", "verdict", "figure", "limit", "what was found", "what to do"),
        tuple(_check_row(check) for check in checks),
        marks=tuple(check.verdict for check in checks),
        note="Figures without a unit are counts or ratios. Limits are given: they have no interval."
        if checks
        else "",
    )


def _check_row(check: QualityCheck) -> tuple[str, ...]:
    return (
        check.name,
        verdict_label(check.verdict),
        with_unit(check.value, check.unit),
        with_unit(check.limit, check.unit),
        check.found,
        check.remedy or "nothing",
    )


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


def lineage(known: Mapping[str, str]) -> dict[str, str]:
    """Return what a result was made from, its keys in words."""
    return {_LINEAGE.get(key, formatting.quantity(key)): value for key, value in known.items()}


def conditions(test: ModalTest) -> dict[str, str]:
    """Return the conditions of a test in words, as every report of it gives them."""
    return {
        "temperature": formatting.temperature(test.temperature_c, "not recorded"),
        "hit level over reference level": formatting.plain(test.amplitude, absent="not recorded"),
        "added mass": added_mass(test),
        "measured by": test.operator or "not recorded",
    }


def added_mass(test: ModalTest) -> str:
    mass = test.added_mass
    if mass is None:
        return "none"
    radius_m = mass.radius_of_gyration_m
    size = "" if radius_m is None else f", radius of gyration {radius_m:g} m"
    return f"{mass.mass_kg:g} kg at {mass.x_m:g} m from the deck end{size}"


def parameters(posterior: Posterior) -> Table:
    """Return the parameters of a model class, each with its unit and 90 % interval."""
    rows = []
    for name in posterior.names:
        interval = Interval.of_samples(posterior.parameter(name))
        unit = posterior.unit(name)
        value = size_of(name, "" if unit == "1" else unit, interval)
        symbol = name.rpartition(".")[2].removeprefix("log10_")
        rows.append((formatting.meaning(posterior, name), str(value), symbol))
    return Table(
        f"Parameters of the model class {formatting.model_class(posterior.model)}",
        ("parameter", "value, with 90 % interval", "symbol"),
        tuple(rows),
        note="Ratios and fractions have no unit. Of end stiffnesses the value is the median.",
    )


def model_classes(selection: Selection | None) -> Table:
    """Return the model classes with probability, evidence and tension; empty without any."""
    posteriors = selection.posteriors if selection else ()
    probabilities = selection.probabilities if selection else ()
    tensions_n = [Interval.of_samples(each.tension_n) for each in posteriors]
    unit = force_unit(*(each.mean for each in tensions_n))
    rows = [
        (
            formatting.model_class(posterior.model),
            formatting.probability(probability),
            f"{posterior.log_evidence:.2f}",
            formatting.number(posterior.log_evidence_sd, ".2f"),
            formatting.mean(tension_n.in_unit(unit)),
            formatting.span(tension_n.in_unit(unit)),
        )
        for posterior, probability, tension_n in zip(
            posteriors, probabilities, tensions_n, strict=True
        )
    ]
    compared_on = f"Compared on {formatting.counted_tests(posteriors[0].tests)}. " if rows else ""
    return Table(
        "Model classes",
        ("class", "probability", "log evidence", "its sd", *formatting.tension_headings(unit)),
        fold_improbable(rows, probabilities, "classes") if rows else (),
        note=f"{compared_on}All classes started equally probable, except clamped ones, which "
        "started lower unless the priors are the thesis's. Evidence in natural logarithms, with "
        "the standard deviation of its sampling.",
    )


def settings(known: Mapping[str, str]) -> Table:
    """Return the settings that decide the numbers, each with its unit; empty where nobody says."""
    helps = {row.name: row.help for row in TABLE}
    return Table(
        "Settings in force",
        ("setting", "value", "what it is"),
        tuple(
            (name, value.replace(",", ", "), helps.get(name, "")) for name, value in known.items()
        ),
        note="Of identification, updating and watch, as they stand now: given, without interval.",
    )
