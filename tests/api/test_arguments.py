"""Arguments that cannot be: each refusal names the argument and what to write in Python."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import shm
from shm.errors import BadInput, ShmError, UsageError
from shm.read import write
from shm.values import PLANES, ModalTest, Mode

HANGER = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
TEST = ModalTest("t1", (Mode("transverse", 1, 5.8), Mode("transverse", 2, 13.0)))
Call = Callable[[Path], object]


def _two_hangers(path: Path) -> Path:
    file = path.with_name("two.toml")
    lines = "diameter_m = 0.13\nlength_m = 12.0\nelastic_modulus_pa = 200e9\ndensity_kg_m3 = 7800"
    tables = (f"[[hanger]]\nid = {n}\nnominal_tension_n = 711e3\n{lines}\n" for n in (1, 2))
    file.write_text("".join(tables))
    return file


def _without_units(path: Path) -> Path:
    file = path.with_name("plain.csv")
    file.write_text("time,a1,a2\n" + "".join(f"{n / 100},0.1,0.2\n" for n in range(200)))
    return file


REFUSED: tuple[tuple[Call, type[ShmError], str, str], ...] = (
    (lambda _: shm.load_hanger("nope.toml"), BadInput, "nope.toml: no such file", "shm.round_bar("),
    (lambda p: shm.load_hanger(_two_hangers(p)), BadInput, "2 [[hanger]]", "load_hanger(path, 3)"),
    (lambda p: shm.read(_without_units(p)), BadInput, "no channel holds", 'unit = "m/s2".'),
    (lambda _: shm.Store("/nonexistent"), BadInput, "/nonexistent is no folder", "shm.Store("),
    (lambda p: shm.identify(str(p)), UsageError, "records holds", "shm.identify(shm.read(path))"),  # type: ignore[arg-type]
    (lambda p: shm.identify([p]), UsageError, "records holds", "shm.identify(shm.read(path))"),  # type: ignore[list-item]
    (lambda _: shm.identify([]), UsageError, "no record", "at least one"),
    (lambda p: shm.identify(shm.read(p), hanger=3), UsageError, "hanger is 3", "shm.load_hanger("),  # type: ignore[arg-type]
    (lambda _: shm.update("t1", HANGER), UsageError, "tests holds 't1'", "shm.load_modes("),  # type: ignore[arg-type]
    (lambda _: shm.update(TEST, 3), UsageError, "hanger is 3", "shm.round_bar("),  # type: ignore[arg-type]
    (lambda _: shm.update(TEST, HANGER, samples=-5), UsageError, "samples is -5", "samples=1000"),
    (lambda _: shm.select(TEST, HANGER, samples=0), UsageError, "samples is 0", "samples=1000"),
    (lambda _: shm.update(TEST, HANGER, samples=1.5), UsageError, "samples is 1.5", "samples=1000"),  # type: ignore[arg-type]
    (lambda _: shm.select(TEST, HANGER, models="beam1"), UsageError, "'beam1'", "models=['beam1']"),
    (lambda _: shm.diagnose(TEST, HANGER, draws=-1), UsageError, "draws is -1", "draws=1000"),
    (lambda _: shm.diagnose(TEST, HANGER, seed=-1), UsageError, "seed is -1", "seed=1"),
    (lambda _: shm.diagnose(TEST, HANGER, without="sag"), UsageError, "'sag'", "without=['sag']"),
    (lambda _: shm.check_gap((), HANGER, seeds=0), UsageError, "seeds is 0", "seeds=1"),
    (lambda _: shm.simulate(3), UsageError, "hanger is 3", "shm.round_bar("),  # type: ignore[arg-type]
    (lambda p: shm.read(p, places_m=[1.0]), UsageError, "places_m is a list", '"acc_1": 2.5'),  # type: ignore[arg-type]
    (lambda p: shm.read(p, planes=PLANES), UsageError, "planes is a list", "acc_1, acc_2"),  # type: ignore[arg-type]
    (lambda p: shm.read(p, planes="across"), UsageError, "'across' is no plane", "longitudinal"),  # type: ignore[arg-type]
    (lambda p: shm.read(p, places_m={"acc_1": -3.0}), UsageError, "acc_1 at -3.0", '"acc_1": 2.5'),
    (lambda p: shm.read(p, places_m="x"), UsageError, "acc_1 at 'x'", '"acc_1": 2.5'),  # type: ignore[arg-type]
)  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("read") / "hanger3.csv"
    write(shm.simulate(HANGER, hits=1, seconds_per_hit=4.0), path)
    return path


@pytest.mark.parametrize(("call", "error", "message", "remedy"), REFUSED)
def test_refusal_names_argument(
    path: Path, call: Call, error: type[ShmError], message: str, remedy: str
) -> None:
    with pytest.raises(error) as raised:
        call(path)
    assert type(raised.value) is error
    assert message in str(raised.value)
    assert remedy in raised.value.remedy
    assert "--" not in str(raised.value)


def test_recording_plot_on_one_axes(path: Path) -> None:
    """All channels are in it with a legend; on as many axes as channels each has its own."""
    plt = pytest.importorskip("matplotlib.pyplot")
    record = shm.read(path)
    assert isinstance(record, shm.Recording)
    names = [channel.name for channel in record.channels]
    figure, ax = plt.subplots()
    assert record.plot(ax=ax) is figure
    assert [text.get_text() for text in ax.get_legend().get_texts()] == names
    assert len(ax.lines) == len(names)
    assert ax.get_xlabel() == "time (s)"
    _, each = plt.subplots(len(names))
    record.plot(ax=each)
    assert [len(one.lines) for one in each] == [1] * len(names)
    with pytest.raises(UsageError, match="5 panels, and ax has 2"):
        record.plot(ax=each[:2])
    plt.close("all")
