"""How values show themselves in a notebook: small tables with units, figures as pictures.

`import shm` in a notebook is enough; elsewhere `%load_ext shm.notebook`. IPython finds the
functions below by the names of the classes, so that the values stay plain data and nothing is
imported before it is shown.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shm.report.intervals import Interval
    from shm.values import Diagnosis, Hanger, Posterior, Selection

_CAUSES_SHOWN = 5  # technical: rows of a cell's table


def load_ipython_extension(shell: Any) -> None:
    """Tells a shell of IPython how to show a hanger, posterior, selection, diagnosis, figure."""
    html = shell.display_formatter.formatters["text/html"]
    for home, kind, shown in (
        ("shm.values.hanger", "Hanger", hanger_html),
        ("shm.values.posterior", "Posterior", posterior_html),
        ("shm.values.posterior", "Selection", selection_html),
        ("shm.values.diagnosis", "Diagnosis", diagnosis_html),
    ):
        html.for_type_by_name(home, kind, shown)
    png = shell.display_formatter.formatters["image/png"]
    before = png.for_type_by_name("matplotlib.figure", "Figure", figure_png)
    if before is not None:
        png.for_type_by_name("matplotlib.figure", "Figure", before)


def hanger_html(hanger: Hanger) -> str:
    """The description of a hanger, in the units of a drawing."""
    from shm.report import formatting
    from shm.values.force_units import force_unit

    nominal_n, stiffness = hanger.nominal_tension_n, hanger.bending_stiffness_n_m2
    unit = force_unit(nominal_n)
    round_bar = math.isfinite(hanger.diameter_m)
    rows = [
        ("diameter", f"{1e3 * hanger.diameter_m:.0f} mm" if round_bar else "not round"),
        ("length", f"{hanger.length_m:.3f} m"),
        ("area", f"{1e6 * hanger.area_m2:.0f} mm²"),
        ("mass", f"{hanger.mass_per_length_kg_m:.1f} kg/m"),
        ("bending stiffness", f"{formatting.rounded_tension(stiffness, force_unit(stiffness))} m²"),
        ("nominal tension", f"{unit.of(nominal_n):.{unit.decimals(nominal_n)}f} {unit.name}"),
        ("ends", f"{hanger.supports.deck} (deck), {hanger.supports.arch} (arch)"),
        ("end plates", "yes" if hanger.plate else "none"),
    ]
    return _table(formatting.hanger_name(hanger.id, hanger.name), ("", ""), rows)


def posterior_html(posterior: Posterior) -> str:
    """Tension and parameters: mean, 90 % interval, most probable value, meaning."""
    from shm.report import formatting
    from shm.report.intervals import Interval
    from shm.values.force_units import force_unit

    tension_n = Interval.of_samples(posterior.tension_n)
    unit = force_unit(tension_n.mean)
    best = dict(zip(posterior.names, posterior.most_probable, strict=True))
    at_best = unit.of(best["theta_F"] * posterior.nominal_tension_n)
    rows = [
        _interval_row("tension", tension_n.in_unit(unit), at_best, f"tension in {unit.name}"),
    ]
    for name in posterior.names:
        interval = Interval.of_samples(posterior.parameter(name))
        rows.append(
            _interval_row(name, interval, best[name], formatting.meaning(name, posterior.model))
        )
    head = ("", "mean", "90 % interval", "most probable", "what it is")
    return _table(f"{_whose(posterior)}, {formatting.model_class(posterior.model)}", head, rows) + (
        f"<p>{len(posterior.samples)} draws, log evidence {posterior.log_evidence:.2f} "
        f"± {formatting.number(posterior.log_evidence_sd, '.2f')}, "
        f"R-hat {formatting.number(posterior.r_hat, '.3f')}.</p>"
    )


def selection_html(selection: Selection) -> str:
    """The model classes, most probable first, with the tension that each gives."""
    from shm.report import formatting
    from shm.report.intervals import Interval
    from shm.values.force_units import force_unit

    tensions_n = [Interval.of_samples(each.tension_n) for each in selection.posteriors]
    unit = force_unit(*(each.mean for each in tensions_n))
    rows = []
    for posterior, probability, tension_n in zip(
        selection.posteriors, selection.probabilities, tensions_n, strict=True
    ):
        tension = tension_n.in_unit(unit)
        rows.append(
            (
                formatting.model_class(posterior.model),
                formatting.probability(probability),
                f"{posterior.log_evidence:.2f}",
                formatting.mean(tension),
                formatting.span(tension),
            )
        )
    head = ("class", "probability", "log evidence", *formatting.tension_headings(unit))
    return _table(f"{_whose(selection.selected)}, model classes", head, rows)


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """The verdict in words, the likeliest causes, no gap, something unknown."""
    from shm.report import formatting
    from shm.report.diagnosis_summary import consequences, verdict
    from shm.report.diagnosis_wording import claims, label

    causes = [cause for claim in claims(diagnosis) for cause in claim.causes]
    rows = [
        (label(each), formatting.probability(each.probability)) for each in causes[:_CAUSES_SHOWN]
    ]
    rows += [
        ("no gap", formatting.probability(diagnosis.no_gap_probability)),
        (
            "something not in the catalogue",
            formatting.probability(diagnosis.unexplained_probability),
        ),
    ]
    whose = "" if diagnosis.hanger is None else f" of hanger {diagnosis.hanger}"
    title = f"Gap{whose} to {formatting.model_class(diagnosis.baseline)}"
    paragraph = f"{verdict(diagnosis)} {consequences(diagnosis)}".strip()
    return _table(title, ("cause", "probability"), rows) + f"<p>{escape(paragraph)}</p>"


def figure_png(figure: Figure) -> bytes:
    """A picture of a figure, also of one that pyplot does not know."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _whose(posterior: Posterior) -> str:
    return "Posterior" if posterior.hanger is None else f"Hanger {posterior.hanger}"


def _interval_row(name: str, interval: Interval, best: float, meaning: str) -> tuple[str, ...]:
    from shm.report import formatting

    return (
        name,
        formatting.mean(interval),
        formatting.span(interval),
        f"{best:.{formatting.decimals(interval.width)}f}",
        meaning,
    )


def _table(title: str, head: Sequence[str], rows: Sequence[tuple[str, ...]]) -> str:
    headings = "".join(f"<th>{escape(each)}</th>" for each in head)
    shown = f"<thead><tr>{headings}</tr></thead>" if any(head) else ""
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><caption>{escape(title)}</caption>{shown}<tbody>{body}</tbody></table>"
