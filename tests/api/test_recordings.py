"""A recording in a researcher's hand: read with planes and places, shown, drawn on axes."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import shm
from shm.api.in_python import in_python
from shm.errors import BadInput, NothingThere, UsageError
from shm.read import write


@pytest.fixture
def path(recording: shm.Recording, tmp_path: Path) -> Path:
    file = tmp_path / "hanger3.csv"
    write(recording, file)
    return file


def test_planes_and_places_override_the_file(path: Path) -> None:
    """By name, or one for all accelerations; what is not named stays as the file says."""
    before = shm.read(path)
    assert isinstance(before, shm.Recording)
    moved = shm.read(path, planes="longitudinal", places_m={"acc_1": 3.25, "force": 1.5})
    assert isinstance(moved, shm.Recording)
    assert {each.plane for each in moved.accelerations} == {"longitudinal"}
    assert moved.accelerations[0].x_m == 3.25
    assert moved.force is not None
    assert moved.force.x_m == 1.5
    assert [e.x_m for e in moved.accelerations[1:]] == [e.x_m for e in before.accelerations[1:]]


def test_units_override_the_file(path: Path, tmp_path: Path) -> None:
    before = shm.read(path)
    given = shm.read(path, units={"force": "kN", "acc_1": "g"})
    assert isinstance(before, shm.Recording)
    assert isinstance(given, shm.Recording)
    scales = [
        float(new.values.max() / old.values.max())
        for new, old in zip(given.channels[:3], before.channels[:3], strict=True)
    ]
    assert scales == pytest.approx([1000.0, 9.80665, 1.0])
    plain = tmp_path / "plain.csv"
    plain.write_text("Zeit;Kraft;Besch1\n" + "".join(f"{i / 512};1;2\n" for i in range(60)))
    with pytest.raises(BadInput, match=r"shm.read\(path, units=\{...\}\)"):
        shm.read(plain)
    read = shm.read(plain, units={"Kraft": "kN", "Besch1": "g"}, places_m={"Besch1": 2.5})
    assert isinstance(read, shm.Recording)
    assert [each.quantity for each in read.channels] == ["force", "acceleration"]


def test_a_channel_plane_or_file_that_is_not_there_is_refused(path: Path) -> None:
    for given, said in (
        ({"planes": {"acc_9": "transverse"}}, "'acc_9', which the file does not have"),
        ({"places_m": {"acc_9": 1.0}}, "'acc_9', which the file does not have"),
        ({"planes": "vertical"}, "'vertical' is no plane"),
        ({"units": {"acc_9": "g"}}, "'acc_9', which the file does not have.* acc_1"),
        ({"units": "g"}, 'units={"force": "kN"'),
    ):
        with pytest.raises(UsageError, match=said):
            shm.read(path, **given)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match=r"none\.csv"):
        shm.read(path.with_name("none.csv"))


def test_responses_are_placed(identified: shm.Identification, hanger: shm.Hanger) -> None:
    from shm.api.placing import with_places

    response = identified.frequency_response
    assert response is not None
    name = response.points[0].name
    placed = with_places(response, {name: "transverse"}, {name: 0.5})
    assert isinstance(placed, shm.FrequencyResponse)
    assert (placed.points[0].plane, placed.points[0].x_m) == ("transverse", 0.5)
    assert placed.points[1:] == response.points[1:]


def test_a_recording_shows_its_channels(recording: shm.Recording) -> None:
    text = recording.summary()
    assert text.startswith("Recording ")
    assert "24 s at 512 Hz" in text
    for channel in recording.channels:
        assert re.search(rf"^{channel.name} +{channel.quantity}", text, re.MULTILINE)
    assert not re.search(r"\bnan\b|None", text)
    assert "<caption>Recording" in recording._repr_html_()
    figure = recording.plot()
    assert len(figure.axes) == len(recording.channels)
    assert figure.axes[-1].get_xlabel() == "time (s)"
    assert "acceleration (m/s²)" in figure.axes[1].get_ylabel().replace("\n", " ")


def test_a_figure_is_drawn_on_given_axes_if_they_are_enough(
    posterior: shm.Posterior, hanger: shm.Hanger, recording: shm.Recording
) -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert shm.plot.tension(posterior, hanger, ax=left) is figure
    assert left.get_xlabel() == "tension (kN)"
    assert len(left.patches) > 10
    assert not right.has_data()
    axes = Figure().subplots(1, 2)
    with pytest.raises(UsageError, match=r"has 5 panels, and ax has 2.*plt.subplots\(5\)"):
        shm.plot.recording(recording, ax=axes)


def test_errors_name_calls_and_not_commands() -> None:
    with pytest.raises(BadInput) as raised, in_python():
        raise BadInput("no plane.", remedy="Write x_m and plane into the header or a sidecar.")
    assert "shm.read(path, planes={...}, places_m={...})" in raised.value.remedy
    with pytest.raises(NothingThere) as missing, in_python():
        raise NothingThere("no gap.", remedy="Run `shm gap diagnose --hanger 3`.")
    assert missing.value.remedy == "Run shm.diagnose(tests, hanger)."
    with pytest.raises(UsageError) as kept, in_python():
        raise UsageError("no sampler.", remedy="Name one of a, b.")
    assert kept.value.remedy == "Name one of a, b."


def test_an_average_over_classes_is_a_property(posterior: shm.Posterior) -> None:
    choice = shm.Selection((posterior,), (1.0,))
    assert choice.averaged.tension_n.mean == pytest.approx(posterior.tension_n.mean())
    assert math.isnan(choice.averaged.probability_slack)
