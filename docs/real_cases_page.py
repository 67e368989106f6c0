"""Makes the answers of docs/trials/real_cases.md in two minutes.

python docs/real_cases_page.py [DATA]

DATA is the folder of the real data (default: the environment's SHM_DATA, or ../shared/data beside
the checkout). Without it nothing is made, and it says so.
"""

from __future__ import annotations

import csv
import gzip
import math
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TypeAlias

import numpy as np

from docs.filling import fill_in, write_csv
from shm.bridge import load_hanger
from shm.gap import GapOptions, diagnose
from shm.identify import IdentifyOptions, identify
from shm.report.as_text import as_text
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_report import diagnosis_paper
from shm.report.diagnosis_wording import label
from shm.report.formatting import probability
from shm.report.sizes import quantity, size
from shm.values import (
    Cause,
    Diagnosis,
    EffectEstimate,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Mode,
    Outcome,
    ResponsePoint,
    Scatter,
    Supports,
)
from shm_cli.common import markdown

DOCS = Path(__file__).parent
HANGERS = DOCS / "trials" / "real_cases"
SEED = 1
HAMMER_X_M = (0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2)
GRAVITY_M_S2 = 9.81
END = "rotational_end_flexibility"
_FORCE_SD_N, _FREQUENCY_SD_HZ = 1.0, 0.5
_WORTH_A_ROW = 0.01
_CLAMPS, _LENGTHS = "clamps.csv", "arrangements_of_ca.csv"
_CAUSE_HEAD = ("cause", "probability", "log Bayes factor", "size (90 % interval)")
_FAMILY_HEAD = (
    "clamp", "direction", "arrangements", "lengths (m)", "measured over pendulum", "no gap",
    "none of them", "what leads (in how many)", "probability of the leading cause",
    "with its group",
)  # fmt: skip
_LENGTH_HEAD = (
    "length (m)", "measured over pendulum", "likeliest", "alike", "together",
    "log10 k of the hinge, were it the cause (N m/rad)",
)  # fmt: skip


def data_folder() -> Path:
    """Where the real data are, or would be."""
    return Path(os.environ.get("SHM_DATA", DOCS.parents[1] / "shared" / "data"))


# ---------------------------------------------------------------- a free bar


def roving_beam(data: Path) -> tuple[Hanger, list[ModalTest]]:
    """Return the bar and its one test, identified from nine frequency responses."""
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
    """Return the string and a test at each tension that was read, with the modes of `orders`."""
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

    @property
    def over_pendulum(self) -> list[float]:
        """Measured frequencies over the pendulum's, one for each test."""
        return [test.modes[0].frequency_hz / self.pendulum_hz for test in self.tests]


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
    """Return a steel rod, hinged above, with the mass at its lower end and its weight in it."""
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


Diagnosed: TypeAlias = tuple[Arrangement, Diagnosis]


def pipe_hanger_tables(data: Path) -> str:
    """Files of a row for each clamp and direction, and of each of CA; here what names them."""
    found = [
        (each, diagnose(each.tests, each.hanger, GapOptions(seed=SEED)))
        for each in arrangements(data)
    ]
    families: dict[tuple[str, str], list[Diagnosed]] = {}
    for each, diagnosis in found:
        key = (each.name.split("_")[0], each.direction)
        families.setdefault(key, []).append((each, diagnosis))
    shortest_first = sorted(families["CA", "radial"], key=lambda pair: pair[0].hanger.length_m)
    write_csv(HANGERS / _LENGTHS, [_LENGTH_HEAD, *(_length_row(*pair) for pair in shortest_first)])
    clamps = (_family_row(key, pairs) for key, pairs in families.items())
    write_csv(HANGERS / _CLAMPS, [_FAMILY_HEAD, *clamps])
    hinges = [hinge for _, diagnosis in shortest_first if (hinge := _hinge(diagnosis))]
    return "\n\n".join(
        (
            f"[Each clamp and direction](real_cases/{_CLAMPS}).",
            f"[The arrangements of CA](real_cases/{_LENGTHS}), the shortest rods first.",
            _one_hinge(hinges),
        )
    )


def _family_row(key: tuple[str, str], pairs: Sequence[Diagnosed]) -> tuple[str, ...]:
    leading = Counter(_leading(diagnosis) for _, diagnosis in pairs)
    return (
        *key,
        str(len(pairs)),
        _span([each.hanger.length_m for each, _ in pairs], 2),
        _span([ratio for each, _ in pairs for ratio in each.over_pendulum], 3),
        _span([diagnosis.no_gap_probability for _, diagnosis in pairs], 2),
        _span([diagnosis.unexplained_probability for _, diagnosis in pairs], 2),
        ", ".join(f"{what} ({times})" for what, times in leading.most_common()),
        _span([cause.probability for _, found in pairs if (cause := found.leading)], 2),
        _span([found.claim(cause) for _, found in pairs if (cause := found.leading)], 2),
    )


def _length_row(each: Arrangement, found: Diagnosis) -> tuple[str, ...]:
    best, hinge = max(found.causes, key=lambda each: each.probability), _hinge(found)
    group = found.groups[best.group] if best.group is not None else ()
    return (
        f"{each.hanger.length_m:.3f}",
        _span(each.over_pendulum, 3),
        f"{_words(best.effect)} {best.probability:.2f}",
        ", ".join(_words(name) for name in group if name != best.effect),
        f"{found.claim(best):.2f}",
        f"{hinge.mean:.2f} +- {hinge.sd:.2f}" if hinge else "",
    )


def _leading(found: Diagnosis) -> str:
    verdict = found.verdict
    if verdict.claim is not None:
        return _words(verdict.claim.leading.effect)
    return "no gap" if verdict.outcome is Outcome.NO_GAP else "none of them"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _span(values: Sequence[float], digits: int) -> str:
    """`0.98 to 1.02`; nothing where there are none."""
    if not values:
        return ""
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def _hinge(found: Diagnosis) -> EffectEstimate | None:
    """Return the rotational stiffness of a hinge, were that the only cause."""
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


def told(file: str, hanger: Hanger, tests: list[ModalTest]) -> str:
    """Return the causes above 1 %; the answer in words goes into a file beside."""
    found = diagnose(tests, hanger, GapOptions(seed=SEED))
    paper = diagnosis_paper(DiagnosisSheet(found, hanger))
    text = as_text(paper).split(f"\n{paper.parts[2].title}\n")[0]
    rows = [_cause_row(cause) for cause in found.causes if cause.probability >= _WORTH_A_ROW]
    rows += [
        ("no gap", probability(found.no_gap_probability), "", ""),
        ("something not in the catalogue", probability(found.unexplained_probability), "", ""),
    ]
    (HANGERS / file).write_text(f"{text.rstrip()}\n", encoding="utf-8")
    said = f"[What `shm gap diagnose` says](real_cases/{file}), and the causes above 0.01:"
    return f"{said}\n\n{markdown(_CAUSE_HEAD, rows)}{_tensions(found)}"


def _tensions(found: Diagnosis) -> str:
    """Return a line on the tension by the baseline and by all that may be; none of a bar."""
    before, after = found.tension_before_n, found.tension_after_n
    if not math.isfinite(after.mean):
        return f"\n\nBaseline {found.baseline}."
    words = (f"{each.mean:.1f} N ({each.q05:.1f} to {each.q95:.1f} N)" for each in (before, after))
    return f"\n\nTension: by the baseline {found.baseline} {', by all that may be '.join(words)}."


def _cause_row(cause: Cause) -> tuple[str, ...]:
    sizes = [f"{quantity(each)} {size(each)}" for each in cause.parameters]
    return (
        label(cause),
        probability(cause.probability),
        f"{cause.log_bayes_factor:+.1f}",
        "; ".join(sizes),
    )


def main(data: Path) -> None:
    """Fill in the answers."""
    if not data.is_dir():
        print(f"docs/trials/real_cases.md is left as it is: no real data in {data} (SHM_DATA).")
        return
    page = DOCS / "trials" / "real_cases.md"
    fill_in(page, "free bar", told("free_bar.txt", *roving_beam(data)))
    fill_in(page, "string", told("string.txt", *string(data)))
    fill_in(page, "string, all modes", told("string_all_modes.txt", *string(data, (1, 2, 3))))
    fill_in(page, "pipe hangers", pipe_hanger_tables(data))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else data_folder())
