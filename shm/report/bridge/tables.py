"""The tables and the summary of a bridge: one source for terminal and page."""

from __future__ import annotations

from collections.abc import Sequence

from shm.report import words
from shm.report.bridge.content import BridgeReport, HangerLine
from shm.report.content import Interval
from shm.report.summary import Status
from shm.report.table import Table
from shm.watch.neighbours import BridgePattern, HangerRow

_BAR = 6


def summary(data: BridgeReport) -> str:
    """How many hangers are in which state, what moved over the bridge, what to do."""
    told = data.pattern.sentence if data.pattern else data.why_no_pattern
    remarks = data.pattern.remarks if data.pattern else ()
    return " ".join((f"{_counts(data.hangers)}.", told, *remarks))


def tables(data: BridgeReport, *, bars: bool = False) -> tuple[Table, ...]:
    """All tables that this report can fill; `bars` where there is no figure beside them."""
    return (_hangers(data), *(pattern_tables(data.pattern, bars=bars) if data.pattern else ()))


def pattern_tables(pattern: BridgePattern, *, bars: bool) -> tuple[Table, Table]:
    """Each hanger's shift, and the explanations of all shifts together."""
    return shift_table(pattern, bars=bars), Table(
        "What explains them",
        ("explanation", "probability"),
        tuple((each.name, words.probability(each.probability)) for each in pattern.explanations),
    )


def shift_table(pattern: BridgePattern, *, bars: bool = False) -> Table:
    """Shifts of the tension since each hanger's baseline; those not compared stand last."""
    headings: tuple[str, ...] = ("shift, kN (90 %)", "shift, % (90 %)", "it has", "test of")
    rows = [_shift(row) for row in pattern.rows]
    rows += [
        (str(each.hanger), "", "", "not compared", _day(each.time)) for each in pattern.not_compared
    ]
    note = (
        "Shift of the tension since the baseline at each hanger's latest test, the swing with the "
        "temperature taken out, with 90 % intervals; whether it has lost or gained, with the "
        "probability of that."
    )
    if bars:
        drawn = [bar(share) for share in _shares(pattern)] + [""] * len(pattern.not_compared)
        headings = ("lost | gained", *headings)
        rows = [(first, stroke, *rest) for (first, *rest), stroke in zip(rows, drawn, strict=True)]
    return Table("Shifts along the bridge", ("hanger", *headings), tuple(rows), note=note)


def _shares(pattern: BridgePattern) -> list[float]:
    """Of the largest shift."""
    widest = max(abs(row.shift_fraction) for row in pattern.rows) or 1.0
    return [row.shift_fraction / widest for row in pattern.rows]


def _shift(row: HangerRow) -> tuple[str, ...]:
    newtons = Interval(row.shift_n, row.low_n, row.high_n)
    fraction = Interval(row.shift_fraction, row.low_fraction, row.high_fraction)
    return (
        str(row.hanger),
        _one_decimal(words.kilonewtons(newtons)),
        _one_decimal(fraction.scaled(100)),
        f"{row.way} ({words.probability(row.probability)})",
        _day(row.time),
    )


def bar(share: float) -> str:
    """A share of the largest shift, -1 to 1, as `...<==|......`."""
    length = round(abs(share) * _BAR)
    stroke = "=" * (length - 1)
    left = f"<{stroke}" if share < 0 and length else ""
    right = f"{stroke}>" if share > 0 and length else ""
    return f"{left.rjust(_BAR, '.')}|{right.ljust(_BAR, '.')}"


def _one_decimal(interval: Interval) -> str:
    return f"{interval.mean:+.1f} ({interval.low:+.1f} to {interval.high:+.1f})"


def _hangers(data: BridgeReport) -> Table:
    return Table(
        "Hangers",
        (
            "hanger", "state", "tension, kN (90 %)", "% of nominal", "called since the baseline",
            "open alerts", "latest test",
        ),
        tuple(_hanger(line) for line in data.hangers),
        note="Tensions with 90 % intervals. Alert: beyond a threshold. Watch: a change was called, "
        "or a shift beyond a threshold is likelier than not. More: shm report --hanger N.",
    )  # fmt: skip


def _hanger(line: HangerLine) -> tuple[str, ...]:
    name = f"{line.hanger.id} {line.hanger.name}".strip()
    if line.tension_n is None or line.status is None:
        return (name, "no test", *[""] * 3, str(line.open_alerts or "none"), "")
    kilonewtons = words.kilonewtons(line.tension_n)
    return (
        name,
        line.status.value,
        f"{words.mean(kilonewtons)} ({words.span(kilonewtons)})",
        f"{100 * line.tension_n.mean / line.hanger.nominal_tension_n:.1f}"
        if line.hanger.nominal_tension_n > 0
        else "no nominal",
        line.called or "nothing",
        str(line.open_alerts or "none"),
        _day(line.latest),
    )


def _counts(lines: Sequence[HangerLine]) -> str:
    counts = [
        (status.value, [str(line.hanger.id) for line in lines if line.status is status])
        for status in (*Status, None)
        if status is not None
    ]
    told = [
        f"{name}: {words.counted(len(ids), 'hanger')}"
        + (f" ({words.listed(ids)})" if name in (Status.ALERT.value, Status.WATCH.value) else "")
        for name, ids in counts
        if ids
    ]
    missing = sum(line.status is None for line in lines)
    told += [f"without a test: {words.counted(missing, 'hanger')}"] if missing else []
    return "; ".join(told)


def _day(time: object) -> str:
    return f"{time:%Y-%m-%d}" if time else "none"
