"""Fixed files of the contract of reading, and what is noted of each.

`write_read_golden.py` makes the golden files from them, `test_read_contract.py` compares.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import FORMATS, Peek, peek_test, read_test
from shm.read.registry import survey
from shm.values import AddedMass, Channel, FrequencyResponse, Recording, ResponsePoint
from shm_cli.main import run
from tests.contracts.inference_calls import GOLDEN
from tests.helpers.logger_texts import FORCE, PLAIN, RATE, SHAPES, german, rows
from tests.helpers.written import holds_responses, write

FOLDER = GOLDEN / "read"

HEAD = "# sampling_rate_hz: 512\n"
TABLE = "force,acc_1\n" + "0.5,-0.25\n" * 40
REFUSED: Mapping[str, tuple[str, str | bytes]] = {
    "no rate": ("a.csv", "force,acc_1\n" + "1,2\n" * 40),
    "short": ("a.csv", HEAD + "force,acc_1\n1,2\n2,3\n"),
    "no names": ("a.csv", HEAD + "1,2\n" * 40),
    "a name twice": ("a.csv", HEAD + TABLE.replace("force", "acc_1")),
    "a word in a cell": ("a.csv", HEAD + TABLE + "0.5,much\n" + "1,2\n"),
    "a row too long": ("a.csv", HEAD + TABLE + "1,2,3\n"),
    "infinite": ("a.csv", HEAD + TABLE + "1,inf\n1,2\n"),
    "uneven times": ("a.csv", "time,acc_1\n" + "".join(f"{i * i},1\n" for i in range(40))),
    "another rate": ("a.csv", HEAD + "time,acc_1\n" + "".join(f"{i},1\n" for i in range(40))),
    "no acceleration": ("a.csv", "Time (s),Force (N),Vel (mm/s)\n" + PLAIN),
    "split decimals": (
        "a.csv", "Zeit,Kraft,Acc\n" + rows(lambda i: f"{german(i / RATE)},{german(FORCE[i])},1,5"),
    ),
    "a second record": ("a.csv", ("Time (s),Force (N),Acc (g)\n" + PLAIN) * 2),
    "a damaged row": ("a.csv", "Time (s),Force (N),Acc (g)\n" + PLAIN.replace("0.100,", "x.1,")),
    "empty": ("a.csv", ""),
    "a picture": ("a.csv", b"\x89PNG\r\n" + bytes(range(32)) * 9),
    "another suffix": ("a.doc", HEAD + TABLE),
    "another content": ("a.uff", HEAD + TABLE),
    "hdf5 cut off": ("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(90)),
    "matlab cut off": ("a.mat", b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01IM" + b"\x0e" * 40),
    "uff cut off": ("a.uff", "    -1\n    58\nname\n"),
    "no workbook": ("a.xlsx", b"PK\x03\x04" + b"xl/" * 30),
    "no archive": ("a.zip", b"PK\x03\x04" + bytes(200)),
}  # fmt: skip
"""Files that are refused: their name and content."""
FAULTY_SIDECARS: Mapping[str, str] = {
    "no toml": "hanger = \n",
    "no number": 'hanger = "three"\n',
    "no time": 'time = "tomorrow"\n',
    "no rate": "sampling_rate_hz = 0\n",
    "no such channel": '[channel.acc_9]\nunit = "g"\n',
    "no unit": '[channel.acc_1]\nunit = "furlong"\n',
    "no plane": '[channel.acc_1]\nplane = "upwards"\n',
    "misspelt": "hangr = 3\n",
}
"""Sidecars of a sound file, each refused by its name."""
CALLS: Mapping[str, tuple[str, ...]] = {
    "peek": ("ingest", "--peek", "good.csv"),
    "peek of several": ("ingest", "--peek", "good.csv", "bad.csv"),
    "peek of a bad one": ("ingest", "--peek", "bad.csv"),
    "peek of none": ("ingest", "--peek", "missing.csv"),
    "import that asks": ("--workspace", "w", "import", "open.csv", "--dry-run"),
    "import of a bad one": ("--workspace", "w", "import", "bad.csv", "--dry-run"),
    "ingest": ("--workspace", "w", "ingest", "good.csv"),
    "ingest of a bad one": ("--workspace", "w", "ingest", "bad.csv"),
    "identify of a bad one": ("identify", "bad.csv", "--hanger-file", "H.toml"),
}
"""Calls of `shm` of which the exit code is held."""
HANGER = (
    "[[hanger]]\nid = 3\ndiameter_m = 0.13\nlength_m = 12.0\nelastic_modulus_pa = 200e9\n"
    "density_kg_m3 = 7800\nnominal_tension_n = 711e3\n"
)


def recording() -> Recording:
    """Return a force and two accelerations with everything known."""
    values = np.random.default_rng(5).standard_normal((3, 200)).round(6)
    return Recording(
        source="made",
        channels=(
            Channel("force", "force", 800 * values[0], x_m=1.92),
            Channel("acc_1", "acceleration", values[1], "transverse", 2.52),
            Channel("acc_2", "acceleration", values[2], "longitudinal", 2.52),
        ),
        sampling_rate_hz=512.0,
        hanger=3,
        time=datetime(2026, 5, 1, 10, 0, 30, tzinfo=UTC),
        temperature_c=-2.5,
        added_mass=AddedMass(25.0, 3.6, 0.08),
    )


def response() -> FrequencyResponse:
    """Return the accelerances of two points."""
    real, imaginary = np.random.default_rng(6).standard_normal((2, 2, 65)).round(6)
    points = (ResponsePoint("low", "transverse", 2.5), ResponsePoint("high", None, 4.0))
    return FrequencyResponse("made", points, 0.5 * np.arange(65), real + 1j * imaginary, hanger=7)


def sound_files(folder: Path) -> dict[str, Path]:
    """Write a file of each format and of each kind of logger's text; return them by name."""
    found: dict[str, Path] = {}
    for known in FORMATS:
        kinds = {"recording": recording(), "response": response()}
        for kind, made in kinds.items() if holds_responses(known) else [("recording", recording())]:
            path = folder / known.name / f"{kind}{known.suffixes[0]}"
            path.parent.mkdir(exist_ok=True)
            write(made, path)
            found[f"{known.name} {kind}"] = path
    for name, text in SHAPES.items():
        path = folder / f"{name.replace(' ', '_')}.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        found[f"text {name}"] = path
    return found


def noted(path: Path) -> dict[str, Any]:
    """Return layout, look and values of a file, as a document."""
    surveyed = survey(path)
    return {
        "layout": {
            "fingerprint": surveyed.layout.fingerprint,
            "format": surveyed.layout.format,
            "columns": list(surveyed.layout.columns),
        },
        "look": [_look(each) for each in peek_test(path)],
        "values": [_values(each) for each in read_test(path)],
    }


def _look(look: Peek) -> dict[str, Any]:
    return {
        "format": look.format,
        "samples": look.samples,
        "lines": look.lines,
        "rate_hz": _digits(look.sampling_rate_hz),
        "step_hz": _digits(look.frequency_step_hz),
        "hanger": look.hanger,
        "time": look.time.isoformat() if look.time else None,
        "temperature_c": _digits(look.temperature_c),
        "channels": [
            [c.name, c.quantity, c.unit, c.plane, _digits(c.x_m)] for c in look.channels
        ],
        "left_out": list(look.left_out),
        "problems": list(look.problems),
    }  # fmt: skip


def _values(found: Recording | FrequencyResponse) -> list[Any]:
    """Return the root mean square of each channel or point, and its first values."""
    rows = (
        [(c.name, c.values) for c in found.channels]
        if isinstance(found, Recording)
        else [(p.name, v.real) for p, v in zip(found.points, found.accelerance, strict=True)]
    )
    return [
        [name, _digits(float(np.sqrt(np.nanmean(row**2)))), [_digits(float(v)) for v in row[:3]]]
        for name, row in rows
    ]


def _digits(value: float) -> float | None:
    """Return six digits; None of NaN, which JSON does not know."""
    return None if np.isnan(value) else float(f"{value:.6g}")


def refusal(path: Path) -> dict[str, Any]:
    """Return what is said of a file that is refused."""
    try:
        read_test(path)
    except BadInput as error:
        return {
            "message": error.message, "file": Path(error.file).name, "channel": error.channel,
            "line": error.line, "remedy": error.remedy,
        }  # fmt: skip
    return {"message": "read"}


def refusals(folder: Path) -> dict[str, Any]:
    """Return the refusals of all faulty files and sidecars, by name."""
    found: dict[str, Any] = {}
    for name, (file, content) in REFUSED.items():
        path = folder / file
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        found[name] = refusal(path)
    path = folder / "test.csv"
    write(recording(), path)
    for name, text in FAULTY_SIDECARS.items():
        path.with_suffix(".toml").write_text(text)
        found[f"sidecar: {name}"] = refusal(path)
    return found


def exit_codes(folder: Path, patch: pytest.MonkeyPatch) -> dict[str, int]:
    """Return the exit code of each call, made in a folder with files of three kinds."""
    patch.chdir(folder)
    write(recording(), folder / "good.csv")
    (folder / "bad.csv").write_text(REFUSED["a row too long"][1])  # type: ignore[arg-type]
    (folder / "open.csv").write_text("Time [s],Hammer,a1\n" + PLAIN)
    (folder / "H.toml").write_text(HANGER)
    (folder / "bridge.toml").write_text('[bridge]\nname = "x"\n\n' + HANGER)
    assert run(["init", "w", "--from", "bridge.toml"]) == 0
    return {name: run(list(words)) for name, words in CALLS.items()}


def run_all(folder: Path, patch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return every document of the contract, by the name of its golden file."""
    for part in ("sound", "faulty", "calls"):
        (folder / part).mkdir()
    sound = sound_files(folder / "sound")
    return {
        "files": {name: noted(path) for name, path in sound.items()},
        "refusals": refusals(folder / "faulty"),
        "exit_codes": exit_codes(folder / "calls", patch),
    }
