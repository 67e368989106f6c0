"""Values as a person reads them: small tables with units, as text and in a notebook; figures.

`summary()` and the view of a notebook are one sheet, in the words of the report. `import shm` in a
notebook is enough for its figures; elsewhere `%load_ext shm.notebook`.
"""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shm.identify import Identification
    from shm.report.paper import Table
    from shm.values import (
        Diagnosis,
        FloatArray,
        GapCheck,
        Hanger,
        Limits,
        ModalTest,
        Posterior,
        Recording,
        Selection,
    )

_CAUSES_SHOWN = 5  # technical: rows of a cell's table
_WIDTH = 88  # technical: characters of a line in a notebook's cell


def load_ipython_extension(shell: Any) -> None:
    """Register the display of figures in IPython; values show themselves."""
    png = shell.display_formatter.formatters["image/png"]
    before = png.for_type_by_name("matplotlib.figure", "Figure", figure_png)
    if before is not None:
        png.for_type_by_name("matplotlib.figure", "Figure", before)


@dataclass(frozen=True)
class Sheet:
    """A value in words: a titled table of a report, with paragraphs above and under it."""

    table: Table
    notes: tuple[str, ...] = ()
    lead: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """In columns of a notebook's cell."""
        return self.text_of(_WIDTH)

    def text_of(self, width: int) -> str:
        """Return the sheet in lines of at most `width` columns, as a report's text."""
        from shm.report.as_text import laid_out

        lead, notes = (
            [textwrap.fill(each, width) for each in wording] for wording in (self.lead, self.notes)
        )
        table = laid_out(replace(self.table, title="", note=""), width).strip("\n")
        return "\n".join([self.table.title, *lead, table, *notes])

    @property
    def html(self) -> str:
        from shm.report.as_html import table_html

        lead, notes = (
            "".join(f"<p>{escape(each)}</p>" for each in wording)
            for wording in (self.lead, self.notes)
        )
        return f"{lead}{table_html(replace(self.table, note=''))}{notes}"


def _table(title: str, head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Table:
    from shm.report.paper import Table

    return Table(title, head, tuple(rows))


def sheet(value: Any) -> Sheet:
    """Return that of a value which a step of `import shm` takes or gives."""
    return _SHEETS[type(value).__name__](value)


def _hanger(hanger: Hanger) -> Sheet:
    """Show the description of a hanger as reports do, and what follows from it."""
    from shm.report import formatting
    from shm.report.bar_table import bar_rows
    from shm.values.bar_description import describe_bar
    from shm.values.rounding import force_unit

    nominal_n, stiffness = hanger.nominal_tension_n, hanger.bending_stiffness_n_m2
    unit = force_unit(nominal_n)
    rows = [
        *((label.lower(), value) for label, value in bar_rows(describe_bar(hanger))),
        ("bending stiffness", f"{formatting.rounded_tension(stiffness, force_unit(stiffness))} m²"),
        ("nominal tension", f"{unit.of(nominal_n):.{unit.decimals(nominal_n)}f} {unit.name}"),
    ]
    return Sheet(_table(formatting.hanger_name(hanger.id, hanger.name), ("", ""), rows))


def _modal_test(test: ModalTest) -> Sheet:
    """Show when and how warm the test was, and its modes."""
    from shm.report import formatting
    from shm.report.modal_test_report import MODE_HEADINGS, mode_row

    whose = "" if test.hanger is None else f" of hanger {test.hanger}"
    when = f"{formatting.moment(test.time)}, {formatting.temperature(test.temperature_c)}"
    title = f"Modal test {test.id}{whose}, {when}"
    return Sheet(_table(title, MODE_HEADINGS, map(mode_row, test.modes)))


def _identification(found: Identification) -> Sheet:
    """Show the modal test, and below it what its quality warns of and what to do."""
    doubts = (each for each in found.quality if each.verdict in ("warning", "refused"))
    words = (f"{each.name}, {each.verdict}: {each.found}. {each.remedy}".strip() for each in doubts)
    return replace(_modal_test(found.test), notes=tuple(words))


def _recording(recording: Recording) -> Sheet:
    """Show how long, when and how warm, and each channel with its largest value."""
    import numpy as np

    from shm.report import formatting

    whose = "" if recording.hanger is None else f" of hanger {recording.hanger}"
    title = (
        f"Recording {Path(recording.source).name}{whose}, {recording.duration_s:.4g} s at "
        f"{recording.sampling_rate_hz:g} Hz, {formatting.moment(recording.time)}, "
        f"{formatting.temperature(recording.temperature_c)}"
    )
    units = {"force": "N", "acceleration": "m/s²"}
    rows = [
        (
            channel.name,
            channel.quantity,
            channel.plane or "not stated",
            f"{channel.x_m:.2f} m" if math.isfinite(channel.x_m) else "not stated",
            f"{formatting.plain(_largest(channel.values))} {units[channel.quantity]}",
            formatting.counted(int(np.isnan(channel.values).sum()), "gap"),
        )
        for channel in recording.channels
    ]
    head = ("channel", "quantity", "plane", "place", "largest value", "missing samples")
    return Sheet(_table(title, head, rows))


def _largest(values: FloatArray) -> float:
    """Return the largest absolute value; NaN where no sample is known."""
    import numpy as np

    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if len(known) else math.nan


def posterior_sheet(posterior: Posterior, limits: Limits | None = None) -> Sheet:
    """Show tension and parameters, each with its 90 % interval and what it is."""
    from shm.report import formatting, shared_tables
    from shm.values.posterior import WITHOUT_MODEL
    from shm.values.rounding import force_unit
    from shm.values.stated_tension import averaged_now, stated

    if posterior.model == WITHOUT_MODEL:
        values = zip(posterior.names, posterior.most_probable, strict=True)
        title = f"{_whose(posterior)}, measured frequencies without a model"
        rows = ((name, f"{value:.3f}") for name, value in values)
        return Sheet(_table(title, ("mode", "frequency in Hz"), rows))
    sampled = (
        f"{len(posterior.samples)} draws "
        f"({formatting.number(posterior.effective_sample_size, '.0f')} effective), log evidence "
        f"{posterior.log_evidence:.2f} ± {formatting.number(posterior.log_evidence_sd, '.2f')}, "
        f"R-hat {formatting.number(posterior.r_hat, '.3f')}, seed {posterior.seed}."
    )
    title = f"{_whose(posterior)}, {formatting.model_class(posterior.model)}"
    averaged = averaged_now(posterior, limits=limits)
    unit = force_unit(float(posterior.tension_n.mean()))
    lead = (*averaged.caveats, " ".join(stated(averaged, unit).sentences))
    return Sheet(replace(shared_tables.parameters(posterior), title=title), (sampled,), lead)


def selection_sheet(selection: Selection, limits: Limits | None = None) -> Sheet:
    """Show the tension over all classes with its caveats, then what each class gives."""
    from shm.report import shared_tables
    from shm.values.rounding import force_unit
    from shm.values.stated_tension import stated

    unit = force_unit(*(float(each.tension_n.mean()) for each in selection.posteriors))
    averaged = selection.averaged_with(limits)
    lead = (*averaged.caveats, " ".join(stated(averaged, unit).sentences))
    title = f"{_whose(selection.selected)}, model classes"
    return Sheet(replace(shared_tables.model_classes(selection), title=title), lead=lead)


def _diagnosis(diagnosis: Diagnosis) -> Sheet:
    """Return the verdict in words, the most probable causes, no gap, something unknown."""
    from shm.report import formatting
    from shm.report.diagnosis_summary import write_details, write_summary
    from shm.report.diagnosis_wording import label
    from shm.values import group_causes

    causes = [cause for claim in group_causes(diagnosis.causes) for cause in claim.causes]
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
    wording = (write_summary(diagnosis), write_details(diagnosis))
    paragraphs = [paragraph for paragraph in wording if paragraph]
    table = _table(title, ("cause", "probability"), rows)
    return Sheet(table, (*paragraphs, *diagnosis.remarks))


def _gap_check(check: GapCheck) -> Sheet:
    """Show the effects with the sizes from which on they are found."""
    from shm.report.gap_check_report import HEADINGS, check_text, introduction, rows

    whose = "" if check.hanger is None else f" of hanger {check.hanger}"
    title = f"What a diagnosis{whose} would find"
    table = _table(title, HEADINGS, rows(check))
    return Sheet(table, tuple(check_text(check)), (introduction(check),))


def figure_png(figure: Figure) -> bytes:
    """Return a picture of a figure, also of one that pyplot does not know."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _whose(posterior: Posterior) -> str:
    return "Posterior" if posterior.hanger is None else f"Hanger {posterior.hanger}"


_SHEETS: dict[str, Callable[[Any], Sheet]] = {
    "Diagnosis": _diagnosis,
    "GapCheck": _gap_check,
    "Hanger": _hanger,
    "Identification": _identification,
    "ModalTest": _modal_test,
    "Posterior": posterior_sheet,
    "Recording": _recording,
    "Selection": selection_sheet,
}
