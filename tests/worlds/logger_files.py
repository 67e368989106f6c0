"""Exports of a recording in the shapes of loggers: `FORMATS[name].write(path, recording)`.

`write` gives what a perfect reader would hold, or None where the file has no time record and must
be refused, or holds modes.  `to_know` says what a reader has to know of the shape, `not_in_file`
what no reader can find in it and a sidecar has to say.  Place and plane of a sensor are in none but
`catman` (in the names) and UFF and Testlab (the direction).
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tests.worlds import logger_binaries as binaries
from tests.worlds import logger_texts as texts
from tests.worlds.logger_tables import Held
from tests.worlds.logger_xlsx import xlsx
from tests.worlds.recordings import Recording


@dataclass(frozen=True)
class Format:
    """One export."""

    write: Callable[[Path, Recording], Held | None]
    suffix: str
    to_know: str
    not_in_file: str
    holds: Literal["record", "modes", "nothing"] = "record"


FORMATS: dict[str, Format] = {
    "catman": Format(
        texts.catman,
        ".asc",
        "30 lines of preamble; `;`, decimal comma; latin-1; `name [unit]`; rate in `Messrate [Hz]`",
        "time zone",
    ),
    "famos": Format(
        texts.famos,
        ".txt",
        "tab, decimal comma; quoted names, then quoted units; the first column is time in s",
        "when; the rate but for seven digits of time",
    ),
    "dewesoft": Format(
        texts.dewesoft,
        ".txt",
        "keys and values by tab until `Data1`; then names with units in round brackets; UTF-8 mark",
        "time zone; month stands before day",
    ),
    "lvm": Format(
        texts.lvm,
        ".lvm",
        "two headers, each to ***End_of_Header***; no x column, so a line begins with a tab; the "
        "last column is Comment and empty; rate is 1 / Delta_X",
        "time zone",
    ),
    "lvm_segments": Format(
        texts.lvm_segments,
        ".lvm",
        "three segments, each with a header of its own, to be joined by X0; decimal comma",
        "time zone",
    ),
    "signal_express": Format(
        texts.signal_express,
        ".txt",
        "lines `channel names:`, `start times:`, `dt:`, `data:`; day before month",
        "units",
    ),
    "pulse": Format(
        texts.pulse,
        ".txt",
        "signals one below the other, each with 12 lines of header; columns index, time, value",
        "time zone",
    ),
    "testlab": Format(
        texts.testlab,
        ".csv",
        "a row of names, a row of units; `hang:2:+Y` is point 2, direction +Y; +Y is transverse",
        "when; which point is where",
    ),
    "toa5": Format(
        texts.toa5,
        ".dat",
        "lines of station, names, units, processing; two columns before the channels; NAN quoted; "
        "times to a millisecond, so a single step is no measure of the rate",
        "time zone",
    ),
    "picolog": Format(
        texts.picolog,
        ".csv",
        "names, units in brackets, an empty line; time in ms; ****** is overrange: no number",
        "when; full scale",
    ),
    "phyphox": Format(
        texts.phyphox,
        ".csv",
        "unit within the name; samples are not evenly spaced; one axis has gravity",
        "when; which axis is which plane; no hammer",
    ),
    "quickdaq": Format(
        texts.quickdaq,
        ".csv",
        "keys and values, then sample number, time, volts",
        "what a volt is worth; which channel is the hammer",
    ),
    "iso_times": Format(
        texts.iso_times, ".csv", "ISO times with their zone, to a microsecond", "nothing"
    ),
    "german_times": Format(
        texts.german_times,
        ".csv",
        "day before month; a decimal comma in the seconds too; `---` is no number; latin-1",
        "time zone",
    ),
    "utf16": Format(texts.utf16, ".txt", "UTF-16 with its mark; tab; an empty last column", "when"),
    "thousands": Format(
        texts.thousands,
        ".csv",
        "quoted numbers, comma every three digits; the rate in a comment, with a comma too",
        "when",
    ),
    "statistics_tail": Format(
        texts.statistics_tail,
        ".csv",
        "data end at the empty line; what follows is statistics, not samples",
        "when",
    ),
    "uff_58": Format(
        binaries.uff_58,
        ".uff",
        "a dataset a channel, fixed columns; direction 2 is y, 3 z; type 13 force, 12 acceleration",
        "which node is where; gaps are zeros",
    ),
    "uff_58b": Format(binaries.uff_58b, ".uff", "as uff_58, doubles after 11 lines", "as uff_58"),
    "digiducer": Format(
        binaries.digiducer,
        ".wav",
        "24 bits; counts per m/s2 in the comment; both channels are one axis, A of twice B's range",
        "when; that it was 8000 Hz from the start; the hammer",
    ),
    "wav_float": Format(
        binaries.wav_float, ".wav", "32-bit floats, not limited to 1", "units, names, when"
    ),
    "tdms": Format(
        binaries.tdms, ".tdms", "wf_increment, wf_start_time (UTC), unit_string", "nothing"
    ),
    "matlab_struct": Format(
        binaries.matlab_struct,
        ".mat",
        "one struct; data is (samples, channels); names and units are cells in it",
        "time zone",
    ),
    "xlsx": Format(
        xlsx,
        ".xlsx",
        "the first sheet is a chart; names in row 5, units in row 6; gaps are absent cells",
        "the time of the day",
    ),
    "uff_55": Format(
        binaries.uff_55,
        ".uff",
        "a dataset a mode: frequency, modal mass, damping ratio in record 8; shape by node",
        "samples: it holds modes; which node is where",
        "modes",
    ),
    "spectrum": Format(
        texts.spectrum,
        ".csv",
        "the first column is frequency, and values are real: amplitudes, no responses",
        "the time record, and phases",
        "nothing",
    ),
    "miniseed": Format(binaries.miniseed, ".mseed", "a format of seismology", "units", "nothing"),
    "catman_binary": Format(
        binaries.catman_binary, ".bin", "the maker's own; export text", "its layout", "nothing"
    ),
}


def write(name: str, path: Path, recording: Recording) -> Held | None:
    """Writes `recording` at `path` in the shape `name`, and says what the file holds."""
    return FORMATS[name].write(path, recording)
