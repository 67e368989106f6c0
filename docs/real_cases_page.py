"""Makes the answers of docs/real_cases.md: `python docs/real_cases_page.py [DATA]`.

DATA is the folder of the real data (default: the environment's SHM_DATA, or ../shared/data beside
the checkout). Without it nothing is made, and it says so.
"""

from __future__ import annotations

import csv
import gzip
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from shm.bridge import load_hanger
from shm.gap import GapOptions, diagnose
from shm.identify import IdentifyOptions, identify
from shm.report import DiagnosisSheet, diagnosis_text
from shm.values import (
    Diagnosis,
    EffectEstimate,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Mode,
    ResponsePoint,
    Scatter,
    Supports,
)

DOCS = Path(__file__).parent
HANGERS = DOCS / "real_cases"
SEED = 1
HAMMER_X_M = (0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2)
GRAVITY_M_S2 = 9.81
END = "rotational_end_flexibility"
_FORCE_SD_N, _FREQUENCY_SD_HZ = 1.0, 0.5
_HEAD = (
    "arrangement", "direction", "length (m)", "measured over pendulum", "no gap", "none of them",
    "likeliest", "with its group", "log10 k of the hinge (N m/rad)",
)  # fmt: skip


def data_folder() -> Path:
    """Where the real data are, or would be."""
    return Path(os.environ.get("SHM_DATA", DOCS.parents[1] / "shared" / "data"))


# ---------------------------------------------------------------- a free bar


def roving_beam(data: Path) -> tuple[Hanger, list[ModalTest]]:
    """The bar and its one test, identified from nine frequency responses."""
    files = sorted((data / "modelab_roving_beam").glob("*.txt.gz"))
    responses = [_response(file, x_m) for file, x_m in zip(files, HAMMER_X_M, strict=True)]
    hanger = load_hanger(HANGERS / "roving_beam.toml")
    found = identify(responses, IdentifyOptions(50, 1000), test_id="beam", hanger=hanger)
    return hanger, [found.test]


def _response(file: Path, x_m: float) -> FrequencyResponse:
    with gzip.open(file, "rt", encoding="latin1") as lines:
        rows = [line.split() for line in lines if line[:1].isdigit()]
    frequency, real, imaginary = np.array(rows, dtype=float).T
    point = ResponsePoint(file.name, "transverse", x_m)
    return FrequencyResponse(file.name, (point,), frequency, (real + 1j * imaginary)[np.newaxis])


# ---------------------------------------------------------------- a string


def string(data: Path, orders: tuple[int, ...] = (1,)) -> tuple[Hanger, list[ModalTest]]:
    """The string and a test at each tension that was read, with the modes of `orders`."""
    with (data / "danish_string" / "string_T_f1.csv").open(newline="") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: float(row["tension_N"]))
    tests = []
    for tension, same in groupby(rows, key=lambda row: float(row["tension_N"])):
        modes = [(int(row["mode_n"]), float(row["f_hz"])) for row in same]
        kept = [Mode("transverse", n, f, _FREQUENCY_SD_HZ) for n, f in modes if n in orders]
        tests.append(
            ModalTest(
                f"{tension:g} N",
                tuple(kept),
                tension_read_n=tension,
                tension_read_sd_n=_FORCE_SD_N,
            )
        )
    return load_hanger(HANGERS / "string.toml"), tests


# ---------------------------------------------------------------- pipe hangers


@dataclass(frozen=True)
class Arrangement:
    """One way to hang the pipe, in one direction of sway; a test each for its repetitions."""

    name: str
    direction: str
    hanger: Hanger
    tests: tuple[ModalTest, ...]

    @property
    def pendulum_hz(self) -> float:
        return math.sqrt(GRAVITY_M_S2 / self.hanger.length_m) / (2 * math.pi)


def arrangements(data: Path) -> Iterator[Arrangement]:
    """All of them. Of CA the axial values are copies of the radial ones, and left out."""
    path = data / "pipe_hanger_sway" / "hanger_sway_frequencies.csv"
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name, same in groupby(rows, key=lambda row: row["exp_id"].rsplit("_", 1)[0]):
        mine = list(same)
        for direction in ("radial",) if name.startswith("CA") else ("radial", "axial"):
            tests = tuple(
                ModalTest(row["exp_id"], (Mode("transverse", 1, float(row[f"f_{direction}_hz"])),))
                for row in mine
            )
            yield Arrangement(name, direction, _rod(mine[0], direction), tests)


def _rod(row: dict[str, str], direction: str) -> Hanger:
    """A steel rod, hinged above, with the mass at its lower end and that mass's weight in it."""
    radius_m, mass_kg = float(row["rod_radius_m"]), float(row["suspended_mass_kg"])
    area_m2 = math.pi * radius_m**2
    return Hanger(
        id=1,
        length_m=float(row[f"pend_length_{direction}_m"]),
        elastic_modulus_pa=200e9,
        area_m2=area_m2,
        second_moment_m4=math.pi * radius_m**4 / 4,
        mass_per_length_kg_m=7850 * area_m2,
        nominal_tension_n=mass_kg * GRAVITY_M_S2,
        diameter_m=2 * radius_m,
        scatter=Scatter(length=0.01, tension=0.01),
        supports=Supports("free", "pinned", mass_kg),
    )


def pipe_hanger_table(data: Path) -> str:
    """One row for each arrangement and direction, as a markdown table."""
    rows = [_HEAD, ("---",) * len(_HEAD)]
    hinges = []
    for each in arrangements(data):
        found = diagnose(each.tests, each.hanger, GapOptions(seed=SEED))
        rows.append(_row(each, found))
        hinge = _hinge(found)
        if each.name.startswith("CA") and hinge:
            hinges.append(hinge)
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"{table}\n\n{_one_hinge(hinges)}"


def _row(each: Arrangement, found: Diagnosis) -> tuple[str, ...]:
    measured = [test.modes[0].frequency_hz / each.pendulum_hz for test in each.tests]
    best, hinge = found.causes[0], _hinge(found)
    return (
        each.name,
        each.direction,
        f"{each.hanger.length_m:.3f}",
        f"{min(measured):.3f} to {max(measured):.3f}",
        f"{found.no_gap_probability:.2f}",
        f"{found.unexplained_probability:.2f}",
        f"{best.effect.replace('_', ' ')} {best.probability:.2f}",
        f"{found.claim(best):.2f}",
        f"{hinge.mean:.2f} +- {hinge.sd:.2f}" if hinge else "",
    )


def _hinge(found: Diagnosis) -> EffectEstimate | None:
    """The stiffness of a hinge that resists turning, were that the cause alone."""
    alone = next((cause for cause in found.causes if cause.effect == END), None)
    return alone.parameters[0] if alone and alone.parameters else None


def _one_hinge(hinges: list[EffectEstimate]) -> str:
    """Whether one stiffness serves all arrangements of CA."""
    mean, sd = (np.array([getattr(each, name) for each in hinges]) for name in ("mean", "sd"))
    weight = sd**-2
    common = float(weight @ mean / weight.sum())
    misfit = float(weight @ (mean - common) ** 2)
    return (
        f"One stiffness for all {len(hinges)} arrangements of CA: log10 k = {common:.2f} +- "
        f"{weight.sum() ** -0.5:.2f}; its chi-square is {misfit:.1f} on {len(hinges) - 1} degrees "
        f"of freedom."
    )


# ---------------------------------------------------------------- the page


def printed(hanger: Hanger, tests: list[ModalTest]) -> str:
    """What `shm gap diagnose` prints, down to the table of causes."""
    sheet = DiagnosisSheet(diagnose(tests, hanger, GapOptions(seed=SEED)), hanger)
    text = diagnosis_text(sheet).split("\nHOW FAR THE GAP SHRINKS")[0]
    return f"```text\n{text.rstrip()}\n```"


def main(data: Path) -> None:
    """Fills in the answers."""
    if not data.is_dir():
        print(f"docs/real_cases.md is left as it is: no real data in {data} (SHM_DATA).")
        return
    page = DOCS / "real_cases.md"
    answers = {
        "free bar": printed(*roving_beam(data)),
        "string": printed(*string(data)),
        "string, all modes": printed(*string(data, (1, 2, 3))),
        "pipe hangers": pipe_hanger_table(data),
    }
    text = page.read_text(encoding="utf-8")
    for name, answer in answers.items():
        begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{answer}\n{end}{rest.split(end)[1]}"
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else data_folder())
