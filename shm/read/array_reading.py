"""Named arrays become a recording or frequency responses; each format only hands them over.

What each array of a file is for: a channel, a frequency response, times, or nothing of ours.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from shm.errors import BadInput
from shm.read import assemble
from shm.read.arrays import Arrays, Variable, arranged
from shm.read.base import Format, LoggerColumn, LoggerTable, Peek
from shm.read.comma_table import REMEDY, evened, rate_of
from shm.read.header import CHANNEL_KEYS, KEYS, Entry, Header, quantity_named
from shm.read.limits import guarded, limits, refuse_large, refuse_many_samples
from shm.read.logger_words import UNSAID, accelerance_si, unit_of
from shm.read.sidecar import channels_described, with_sidecar
from shm.values import NAN, ComplexArray, FloatArray, FrequencyResponse, Recording

Opener = Callable[[Path], AbstractContextManager[Arrays]]


def format_of_arrays(
    name: str,
    suffixes: tuple[str, ...],
    recognises: Callable[[bytes], bool],
    opened: Opener,
    library: str = "",
) -> Format:
    """The format whose files are opened so; to `peek` loads no channel."""

    @contextmanager
    def choosing(path: Path) -> Iterator[_Chosen]:
        with opened(path) as arrays:
            yield _chosen(arrays, path)

    def read(path: Path) -> Recording | FrequencyResponse:
        with choosing(path) as chosen:
            return _response(chosen) if chosen.is_response else _recording(chosen)

    def peek(path: Path) -> Peek:
        with choosing(path) as chosen:
            return _response_peek(chosen, name) if chosen.is_response else _peek(chosen, name)

    def table(path: Path) -> LoggerTable | None:
        with choosing(path) as chosen:
            return None if chosen.is_response else _table(chosen, name)

    return Format(name, suffixes, recognises, peek, read, table=table, library=library)


@dataclass(frozen=True, eq=False)
class _Chosen:
    """The variables of a file by role, and the names of what is left out."""

    path: Path
    by_role: dict[Role, list[Variable]]
    attributes: dict[str, object]
    left_out: tuple[str, ...]

    @property
    def is_response(self) -> bool:
        """Whether frequency responses are what the file is for: time records go first."""
        recorded = [v for v in self.by_role["channel"] if not v.name.lower().startswith("force")]
        return bool(self.by_role["response"]) and not recorded

    def header(self, used: Sequence[Variable]) -> Header:
        """What attributes and sidecar say about the variables that are used."""
        own = {v.name: self._entries(v) for v in used}
        general = facts(self.attributes)
        for variable in reversed(used):
            general.update(facts(variable.attributes))
        entries = {key: Entry(value, self.path) for key, value in general.items() if key in KEYS}
        everything = [v.name for found in self.by_role.values() for v in found]
        return with_sidecar(Header(self.path, own, entries), self.path, everything)

    def _entries(self, variable: Variable) -> dict[str, Entry]:
        said = {key: variable.attributes[key] for key in CHANNEL_KEYS if key in variable.attributes}
        # A name such as force promises newtons in our own CSV alone.
        unit = unit_in(variable) or ("" if variable.kind == "c" else UNSAID)
        return {k: Entry(v, self.path) for k, v in {**said, "unit": unit}.items()}

    def vector(self, role: Role, length: int) -> Variable | None:
        """The times or frequencies that go with arrays of a length."""
        return next((v for v in self.by_role[role] if v.size == length), None)


def _chosen(arrays: Arrays, path: Path) -> _Chosen:
    described = channels_described(path)
    with guarded(path):
        whole = arranged(arrays)
    by_role: dict[Role, list[Variable]] = {
        "channel": [], "response": [], "coherence": [], "times": [], "frequencies": [],
        "left out": [],
    }  # fmt: skip
    for variable in whole.variables:
        by_role[role(variable, described.get(variable.name))].append(variable)
    out = tuple(variable.name for variable in by_role["left out"])
    return _Chosen(path, by_role, dict(whole.attributes), (*out, *whole.left_out))


# ---------------------------------------------------------------- time records


def _recording(chosen: _Chosen) -> Recording:
    channels = chosen.by_role["channel"]
    _refuse_none(chosen)
    samples = _same_length(channels, chosen.path)
    header = chosen.header(channels)
    values, rate = _real(channels, chosen.path), NAN
    times = chosen.vector("times", samples)
    if times is not None:
        values, rate = evened(_times(times, chosen.path), values, _fault(times, chosen.path))
    _refuse_different_rates(channels, header, chosen.path)
    return assemble.recording(header, values, chosen.path, rate)


def _peek(chosen: _Chosen, name: str) -> Peek:
    channels, path = chosen.by_role["channel"], chosen.path
    header = chosen.header(channels)
    problems: list[str] = []
    samples = assemble.attempt(lambda: _same_length(channels, path), 0, problems)
    return assemble.peeked(
        header, name, samples, lambda: _rate(chosen, header, samples), path, problems,
        chosen.left_out,
    )  # fmt: skip


def _table(chosen: _Chosen, name: str) -> LoggerTable:
    """All rows of numbers that are as long as the channels, or else as most are."""
    out = [v for v in chosen.by_role["left out"] if v.is_series and v.kind != "c"]
    series = [*chosen.by_role["channel"], *out]
    lengths = [v.size for v in chosen.by_role["channel"] or out]
    length = max(set(lengths), key=lengths.count, default=0)
    series = [v for v in series if v.size == length]
    columns = tuple(
        LoggerColumn(v.name, unit_in(v), row)
        for v, row in zip(series, _real(series, chosen.path) if series else (), strict=True)
    )
    header = chosen.header([])
    problems: list[str] = []
    rate = assemble.attempt(lambda: _rate(chosen, header, length), NAN, problems)
    said = assemble.attempt(lambda: header.sampling_rate_hz, NAN, problems)
    hanger = assemble.attempt(lambda: header.hanger, None, problems)
    layout = (name, *(f"{c.name} [{c.unit}]" for c in columns))
    return LoggerTable(columns, said, rate, hanger, None, NAN, 0, layout, (), False)


def _rate(chosen: _Chosen, header: Header, samples: int) -> float:
    """The rate that the times tell, which are loaded only where nothing else says it."""
    _refuse_different_rates(chosen.by_role["channel"], header, chosen.path)
    times = chosen.vector("times", samples)
    if times is None or not math.isnan(header.sampling_rate_hz):
        return NAN
    return rate_of(_times(times, chosen.path), _fault(times, chosen.path))


def _times(variable: Variable, path: Path) -> FloatArray:
    times: FloatArray = _real([variable], path)[0]
    return times


def _fault(times: Variable, path: Path) -> Callable[[int, str], BadInput]:
    return lambda row, what: BadInput(
        f"{what} at sample {row + 1}.", file=path, channel=times.name, remedy=REMEDY
    )


def _refuse_none(chosen: _Chosen) -> None:
    """Raises BadInput, with what the file holds instead, where no channel is found."""
    if not chosen.by_role["channel"]:
        held = ", ".join(chosen.left_out[:20]) or "nothing that is read"
        example = chosen.left_out[0] if chosen.left_out else "acc_1"
        raise BadInput(
            f"no channel holds an acceleration. The file holds {held}.",
            file=chosen.path,
            remedy=f'Say in NAME.toml what each is: [channel."{example}"] with unit = "m/s2".',
        )


def _same_length(variables: Sequence[Variable], path: Path) -> int:
    """The number of values that all have; raises BadInput where they differ or are too many."""
    if variables:
        refuse_many_samples(variables[0].size, path)
    for variable in variables[1:]:
        if variable.size != variables[0].size:
            raise BadInput(
                f"has {variable.size} values, {variables[0].name} {variables[0].size}.",
                file=path,
                channel=variable.name,
                remedy="Export all channels of one recording with one length and rate.",
            )
    return variables[0].size if variables else 0


def _refuse_different_rates(channels: Iterable[Variable], header: Header, path: Path) -> None:
    rates = {str(facts(v.attributes).get("sampling_rate_hz", "")) for v in channels}
    told = header.entries.get("sampling_rate_hz")
    if len(rates) > 1 and (told is None or told.file == path):
        raise BadInput(
            f"the channels have different sampling rates ({', '.join(sorted(rates))}).",
            file=path,
            remedy="Export all channels of one recording with one length and rate.",
        )


# ---------------------------------------------------------------- frequency responses


def _response(chosen: _Chosen) -> FrequencyResponse:
    found, path = chosen.by_role["response"], chosen.path
    lines = _same_length(found, path)
    header = chosen.header(found)
    values = np.array([_loaded(v, path) for v in found], dtype=np.complex128)
    listed = _real([_frequencies(chosen, lines)], path)[0]
    return assemble.frequency_response(
        header, listed, values, _coherence(chosen, header, lines), path
    )


def _response_peek(chosen: _Chosen, name: str) -> Peek:
    found, path = chosen.by_role["response"], chosen.path
    listed = _real([_frequencies(chosen, _same_length(found, path))], path)[0]
    return assemble.peeked_response(chosen.header(found), name, listed, path, chosen.left_out)


def _frequencies(chosen: _Chosen, lines: int) -> Variable:
    found = chosen.vector("frequencies", lines)
    if found is None:
        raise BadInput(
            f"no array holds the frequencies of its {lines} lines.",
            file=chosen.path,
            remedy='Name the array frequency_hz, or give it unit = "Hz" in NAME.toml.',
        )
    return found


def _coherence(chosen: _Chosen, header: Header, lines: int) -> FloatArray | None:
    """Coherences (points, lines) where there is one for each response, else None."""
    known = {v.name: v for found in chosen.by_role.values() for v in found if v.kind != "c"}
    wanted = [
        known.get(says(header.channels[name], "coherence") or f"{name}_coherence")
        for name in header.channels
    ]
    rows = [v for v in wanted if v is not None and v.size == lines]
    return _real(rows, chosen.path) if rows and len(rows) == len(wanted) else None


# ---------------------------------------------------------------- values


def _real(variables: Sequence[Variable], path: Path) -> FloatArray:
    if sum(variable.size for variable in variables) > limits().values_at_once:
        refuse_large((len(variables), variables[0].size), 8, "", path)
    return np.array([_loaded(v, path) for v in variables], dtype=np.float64)


def _loaded(variable: Variable, path: Path) -> FloatArray | ComplexArray:
    refuse_large(variable.shape, max(8, variable.item_bytes), variable.name, path)
    with guarded(path, f"the array {variable.name!r}"):
        values = np.asarray(variable.load())
    if values.shape != variable.shape:
        raise BadInput(
            f"holds {values.size} values where its header says {variable.size}.",
            file=path,
            channel=variable.name,
            remedy="The file is damaged: export or send it again.",
        )
    return values


Role = Literal["channel", "response", "coherence", "times", "frequencies", "left out"]

_TIMES = {"t", "time", "times", "timedomain", "timevector", "timeaxis", "times_s"}
_FREQUENCIES = {"f", "freq", "frequency", "frequencies", "frequencyhz", "freqdomain", "freqhz"}
_SECONDS = {"s", "sec", "second", "seconds"}
_RESPONSES = ("frf", "accelerance")
_MASS = {
    "addedmasskg": "added_mass_kg",
    "addedmassatm": "added_mass_at_m",
    "addedmassradiusm": "added_mass_radius_m",
}
_RATES = {
    "samplingratehz", "samplingrate", "samplerate", "samplefrequency", "samplingfrequency",
    "samplingfreq", "samplefreq", "fs", "fshz", "timesamplerate",
}  # fmt: skip
_STEPS = {"dt", "dts", "timestep", "samplinginterval", "sampleinterval", "wfincrement"}
_MOMENTS = {"time", "starttime", "wfstarttime", "timeutc"}
_UNITS = ("unit", "units", "unit_string", "unitstring", "y_unit", "engineering_units")


def role(variable: Variable, described: Mapping[str, Entry] | None) -> Role:
    """The role of a variable that the sidecar describes so (None: not at all).

    Unit goes before name; what nobody names and does not look like a channel is left out.
    """
    if not variable.is_series or (described and says(described, "leave_out").lower() == "true"):
        return "left out"
    unit = says(described or {}, "unit") or unit_in(variable)
    named = described is not None or quantity_named(variable.name) is not None
    if variable.kind == "c":
        return "response" if _is_accelerance(unit) or _names_response(variable.name) else "left out"
    by_unit = _role_of_unit(unit)
    if by_unit is not None:
        return by_unit
    if variable.name.lower().endswith("_coherence"):
        return "coherence"
    return "channel" if named else _role_of_name(variable.name)


def unit_in(variable: Variable) -> str:
    """The unit that a variable's attributes give, in any of the spellings of loggers."""
    found = (str(variable.attributes[key]) for key in _UNITS if key in variable.attributes)
    return next((text.strip() for text in found if text.strip()), "")


def facts(attributes: Mapping[str, object]) -> dict[str, object]:
    """Hanger, time, temperature, known mass, sampling rate in any of the spellings of loggers."""
    found: dict[str, object] = {}
    for name, value in attributes.items():
        key = _bare(name)
        if key == "hanger":
            found["hanger"] = value
        elif key == "temperaturec":
            found["temperature_c"] = value
        elif key in _MASS:
            found[_MASS[key]] = value
        elif key in _MOMENTS and not isinstance(value, (int, float)):
            found["time"] = value
        elif key in _RATES:
            found["sampling_rate_hz"] = value
        elif key in _STEPS and isinstance(value, (int, float)) and value > 0:
            found.setdefault("sampling_rate_hz", 1 / value)
    return found


def says(described: Mapping[str, Entry], key: str) -> str:
    """What an entry says, empty where there is none."""
    return described[key].text if key in described else ""


def _role_of_unit(unit: str) -> Role | None:
    plain = unit.strip(" []()").lower()
    if plain in _SECONDS:
        return "times"
    if plain == "hz":
        return "frequencies"
    return "channel" if unit_of(unit) is not None else None


def _role_of_name(name: str) -> Role:
    bare = _bare(name)
    if bare in _TIMES:
        return "times"
    return "frequencies" if bare in _FREQUENCIES else "left out"


def _is_accelerance(unit: str) -> bool:
    return "/" in unit.replace(")(", ")/(") and accelerance_si(unit, "") is not None


def _names_response(name: str) -> bool:
    return name.lower().startswith(_RESPONSES) or quantity_named(name) == "acceleration"


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
