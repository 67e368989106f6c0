"""The one table of settings: name, default, unit, help, range.

A value comes from the flag, else the environment (`SHM_<NAME>`), else the table `[settings]` of
`bridge.toml`, else the default here. Help texts and docs are made from `TABLE`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from shm.errors import BadInput, suggest


@dataclass(frozen=True)
class Setting:
    """One row of the table; `low` and `high` bound numbers, both included, `choices` texts.

    A text with `beginnings` is empty or has one of these.
    """

    name: str
    default: float | int | str
    unit: str
    help: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    beginnings: tuple[str, ...] = ()

    @property
    def environment_variable(self) -> str:
        return f"SHM_{self.name.upper()}"

    def parse(self, raw: Any, source: str) -> Any:
        """Return `raw` as a value of this setting's type; raises BadInput naming `source`.

        A list of texts is the same as these parted by commas.
        """
        if isinstance(raw, list) and all(isinstance(each, str) for each in raw):
            raw = ",".join(raw)
        is_text = isinstance(self.default, str)
        if isinstance(raw, bool) or (is_text and not isinstance(raw, str)):
            raise self._refusal(raw, source)
        try:
            value = type(self.default)(raw)
        except (TypeError, ValueError):
            raise self._refusal(raw, source) from None
        if self.choices and value not in self.choices:
            raise self._not_chosen(raw, source)
        if self.beginnings and value and not str(value).startswith(self.beginnings):
            raise BadInput(
                f"setting {self.name} = {raw!r} begins with none of {', '.join(self.beginnings)}.",
                file=source,
                remedy="Write the whole address, or leave it out.",
            )
        rounded = isinstance(raw, float) and value != raw
        if rounded or (isinstance(value, int | float) and not self._holds(value)):
            raise self._refusal(raw, source)
        return value

    def _holds(self, value: float) -> bool:
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)

    def _not_chosen(self, raw: object, source: str) -> BadInput:
        listed = ", ".join(self.choices)
        return BadInput(
            f"setting {self.name} = {raw!r} is none of {listed}.",
            file=source,
            remedy=f"Give one of {listed}; the default is {self.default}.",
        )

    def _refusal(self, raw: object, source: str) -> BadInput:
        kind = {int: "a whole number", float: "a number", str: "a text"}[type(self.default)]
        bounds = "" if self.low is None else f" from {self.low:g}"
        bounds += "" if self.high is None else f" to {self.high:g}"
        return BadInput(
            f"setting {self.name} = {raw!r} is not {kind}{bounds}.",
            file=source,
            remedy=f"Give {kind}{bounds}; the default is {self.default}.",
        )


def _row(
    default: float | int | str, unit: str, help_text: str, low: float | None, high: float | None
) -> Any:
    return field(
        default=default, metadata={"unit": unit, "help": help_text, "low": low, "high": high}
    )


def _choice(help_text: str, *choices: str) -> Any:
    """Declare a text setting that is one of `choices`; the first is the default."""
    return field(default=choices[0], metadata={"unit": "", "help": help_text, "choices": choices})


def _address(help_text: str) -> Any:
    """Declare a web address, empty by default."""
    return field(
        default="",
        metadata={"unit": "", "help": help_text, "beginnings": ("https://", "http://")},
    )


_OTHER_LEVELS = ("debug", "warning", "error")


@dataclass(frozen=True)
class Settings:
    """The values in force; each field is a row of `TABLE`: default, unit, help, low, high."""

    # Its URL may hold a password.
    store: str = field(
        default="",
        repr=False,
        metadata={"unit": "", "help": "URL of a PostgreSQL database; empty: `shm.db`"},
    )
    spool_scan_seconds: float = _row(2.0, "s", "how often the spool is scanned", 0.05, 3600)
    spool_stable_seconds: float = _row(
        2.0, "s", "a file is whole once unchanged for so long", 0, 3600
    )
    future_tolerance_seconds: float = _row(
        86400.0, "s", "a test further ahead of the clock is held; zones differ by 14 hours", 0, None
    )
    max_file_bytes: int = _row(1_000_000_000, "bytes", "larger files are refused", 1, None)
    max_channels: int = _row(16, "", "accelerations that one file may hold", 1, 1000)
    max_samples: int = _row(10_000_000, "", "samples that a channel may hold", 16, None)
    max_header_bytes: int = _row(
        1_000_000, "bytes", "what a file or its sidecar may say before the numbers", 1000, None
    )
    parse_seconds: float = _row(10.0, "s", "processor time for reading one file", 0.1, 3600)
    parse_memory_bytes: int = _row(
        2**30, "bytes", "memory for reading one file; a quarter is read at once", 2**26, None
    )
    band_low_hz: float = _row(2.0, "Hz", "modes below are not looked for", 0, None)
    band_high_hz: float = _row(100.0, "Hz", "modes above are not looked for", 0.1, None)
    identifier: str = _choice("how modes are found", "ssi", "pyoma2")
    cross_check: str = _choice(
        "a second identifier to compare with; auto: pyoma2 of structures without a model",
        "auto",
        "pyoma2",
        "ssi",
        "none",
    )
    estimator: str = _choice("of frequency responses", "h1", "h2", "hv")
    reference_force_n: float = _row(1000.0, "N", "a hit this hard has amplitude 1", 1, None)
    reference_level: float = _row(
        0.0, "", "reports state the tension at this level of the hits as well; 0: not", 0, 100
    )
    frequency_allowance: float = _row(
        1e-4, "", "part of a frequency that differs from test to test unseen", 0, 0.01
    )
    mains_hz: float = _row(50.0, "Hz", "frequency of the power grid", 1, 1000)
    models: str = _row(
        "beam1,beam2,beam3,solid0,solid1,solid2", "", "model classes that compete", None, None
    )
    priors: str = _choice(
        "what is possible before a test: by the hanger's description, or by the thesis",
        "description",
        "thesis",
    )
    samples: int = _row(1000, "", "posterior samples kept a test and class", 100, 1_000_000)
    seed: int = _row(1, "", "seed of the random numbers", 0, None)
    workers: int = _row(1, "", "processes that identify and update", 1, 64)
    scheduler: str = _row(
        "", "", "Dask scheduler whose workers identify and update, as tcp://host:8786", None, None
    )
    baseline_tests: int = _row(1, "", "how many first tests form the baseline", 1, 1000)
    false_call_years: float = _row(
        100.0, "years", "mean time between false alarms of a hanger", 0.1, 1e6
    )
    hook_timeout_seconds: float = _row(30.0, "s", "hook timeout", 0.1, 3600)
    hook_attempts: int = _row(16, "", "most attempts to deliver an alert to a hook", 1, 1000)
    hook_backoff_seconds: float = _row(5.0, "s", "first retry delay (doubles each time)", 0, 86400)
    # Hangers of one bridge are hit one after the other and worked through some seconds each.
    alert_grouping_seconds: float = _row(
        60.0,
        "s",
        "similar alerts of several hangers within this time are one message; 0: never",
        0,
        3600,
    )

    web_hosts: str = _row(
        "", "", "names, parted by commas, by which the web interface may be called", None, None
    )
    pages_address: str = _address(
        "where the web interface answers, as https://shm.example.org: alerts link to it"
    )
    web_proxies: str = _row(
        "127.0.0.1,::1",
        "",
        "addresses, parted by commas, of proxies that are believed whom they were called by",
        None,
        None,
    )
    mqtt_url: str = _row(
        "", "", "broker to take recordings from, as mqtts://user@host:8883", None, None
    )
    mqtt_max_bytes: int = _row(50_000_000, "bytes", "larger messages are refused", 1, 268_435_455)

    ring_days: float = _row(30.0, "days", "raw samples of streams are kept so long", 0.1, 36500)
    ring_bytes: int = _row(
        200_000_000_000, "bytes", "of raw samples kept at most; the oldest go first", 10**6, None
    )
    # Three days offline are caught up with a day to spare.
    late_hours: float = _row(
        96.0, "hours", "samples of a stream that come later are refused", 0.1, 8760
    )
    window_days: float = _row(40.0, "days", "what windows of streams said is kept so long", 1, 3650)

    log_format: str = _choice("of what the daemon tells", "text", "json")
    log_level: str = _choice("the least of what the daemon tells", "info", *_OTHER_LEVELS)
    log_file_bytes: int = _row(
        10_000_000, "bytes", "a log file that has grown so large is put aside", 10_000, None
    )
    log_files: int = _row(5, "", "log files put aside that are kept", 1, 1000)
    min_free_bytes: int = _row(
        2_000_000_000, "bytes", "`shm doctor` warns where a disk has less room", 0, None
    )
    backup_days: float = _row(
        7.0, "days", "`shm doctor` warns where the last backup is older", 0.01, 36500
    )
    quiet_days: float = _row(
        400.0, "days", "`shm doctor` warns of hangers without a test for so long", 0.01, 36500
    )
    campaign_days: float = _row(
        1.0, "days", "tests so near to one of a control hanger are of its campaign", 0.01, 365
    )

    @property
    def model_names(self) -> tuple[str, ...]:
        return tuple(name.strip() for name in self.models.split(",") if name.strip())


TABLE: tuple[Setting, ...] = tuple(
    Setting(row.name, row.default, **row.metadata)  # type: ignore[arg-type]
    for row in fields(Settings)
)


_HELP_AT = 37  # layout: the column at which the meanings begin


def commented() -> str:
    """Return the lines of a new `bridge.toml`: each default, commented out, with its help."""
    lines = []
    for row in TABLE:
        meaning = f"{row.help}, in {row.unit}" if row.unit else row.help
        default = f"# {row.name} = {json.dumps(row.default)} "
        lines.append(f"{default.ljust(_HELP_AT - 1)} # {meaning}\n")
    return "".join(lines)


FORMER = {"identifier = frf": "ssi", "cross_check = frf": "auto"}
"""Choices of former versions that a description may still hold, and what takes their place."""


def load_settings(
    file_table: Mapping[str, object] | None = None,
    flags: Mapping[str, object] | None = None,
    environment: Mapping[str, str] | None = None,
    source: str = "bridge.toml",
) -> Settings:
    """Return the settings in force; raises BadInput for an unknown name or bad value."""
    environment = os.environ if environment is None else environment
    file_table = file_table or {}
    flags = {name: value for name, value in (flags or {}).items() if value is not None}
    _refuse_unknown({**file_table, **flags}, source)
    return Settings(
        **{row.name: _value(row, file_table, flags, environment, source) for row in TABLE}
    )


def _value(
    row: Setting,
    file_table: Mapping[str, object],
    flags: Mapping[str, object],
    environment: Mapping[str, str],
    source: str,
) -> Any:
    if row.name in flags:
        return row.parse(flags[row.name], "command line")
    if row.environment_variable in environment:
        return row.parse(environment[row.environment_variable], row.environment_variable)
    value = file_table.get(row.name, row.default)
    return row.parse(FORMER.get(f"{row.name} = {value}", value), source)


def _refuse_unknown(names: Mapping[str, object], source: str) -> None:
    known = {row.name for row in TABLE}
    for name in names:
        if name not in known:
            raise BadInput(
                f"unknown setting {name!r}.",
                file=source,
                remedy=f"{suggest(name, known)}Known: {', '.join(sorted(known))}.",
            )
