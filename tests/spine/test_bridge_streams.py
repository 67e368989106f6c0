"""`[[stream]]` of bridge.toml: what it may say, and what is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge import Bridge, load_bridge
from shm.errors import BadInput
from shm.resources import default_config
from shm.values.stream import SeedLinkFeed, Stream, StreamChannel
from tests.helpers.comparing import assert_same
from tests.spine.test_bridge import ROUND, written

STREAM = """
[[stream]]
name = "h3"
hanger = 3
sampling_rate_hz = 200
[[stream.channel]]
name = "acc_1"
plane = "transverse"
x_m = 3
full_scale = 20.0
"""
OTHER_CHANNEL = """
[[stream.channel]]
name = "acc_2"
plane = "longitudinal"
x_m = 3.5
"""


def bridge(folder: Path, streams: str) -> Bridge:
    return load_bridge(written(folder, ROUND + streams))


def test_a_stream_has_a_hanger_a_rate_and_sensors(tmp_path: Path) -> None:
    found = bridge(tmp_path, STREAM + OTHER_CHANNEL)
    channels = (
        StreamChannel("acc_1", "transverse", 3.0, 20.0),
        StreamChannel("acc_2", "longitudinal", 3.5),
    )
    assert_same(found.streams, (Stream("h3", 3, 200.0, channels),))
    assert found.stream("h3") is found.streams[0]
    assert found.hanger(3).has_sensors
    assert not bridge(tmp_path, "").hanger(3).has_sensors
    with pytest.raises(BadInput, match=r"'h9' is not described .*known: h3"):
        found.stream("h9")


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ("hanger = 3", "hanger = 4", r"stream h3: hanger = 4 is not described \(known: 3\)"),
        ("hanger = 3", 'hanger = "3"', "is not a whole number"),
        ("hanger = 3", "hangar = 3", "unknown key hangar"),
        ('name = "h3"', 'name = "../h3"', "is no name of at most 64 letters"),
        ("= 200", "= 0", "sampling_rate_hz = 0 is not a positive number"),
        ("x_m = 3", "x_m = 30", "is beyond hanger 3, which is 12 m long"),
        ("transverse", "vertical", "is none of the planes"),
        ("full_scale = 20.0", "full_scale = -1", "full_scale = -1 is not a positive number"),
        (STREAM[STREAM.index("[[stream.channel") :], "", "stream h3: it has no channels"),
        ("[[stream.channel]]", "[stream.channel]", r"Write \[\[stream.channel\]\]"),
    ],
)
def test_a_wrong_stream_is_refused_by_name(
    tmp_path: Path, was: str, becomes: str, said: str
) -> None:
    with pytest.raises(BadInput, match=said) as caught:
        bridge(tmp_path, STREAM.replace(was, becomes))
    assert caught.value.file.endswith("bridge.toml")
    assert caught.value.line is not None


def test_what_is_given_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="stream name h3 is given twice"):
        bridge(tmp_path, STREAM + STREAM)
    with pytest.raises(BadInput, match="channel acc_1 is given twice"):
        bridge(tmp_path, STREAM + OTHER_CHANNEL.replace("acc_2", "acc_1"))


def test_two_streams_of_one_hanger_are_refused_by_both_names(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="streams h3 and h3y are both of hanger 3") as caught:
        bridge(tmp_path, STREAM + STREAM.replace('"h3"', '"h3y"'))
    assert "channels of one stream" in caught.value.remedy


def test_names_that_differ_by_capitals_alone_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="stream name H3 is h3 but for capitals"):
        bridge(tmp_path, STREAM + STREAM.replace('"h3"', '"H3"'))
    with pytest.raises(BadInput, match="channel ACC_1 is acc_1 but for capitals"):
        bridge(tmp_path, STREAM + OTHER_CHANNEL.replace("acc_2", "ACC_1"))
    with pytest.raises(BadInput, match="'H3' is not described") as caught:
        bridge(tmp_path, STREAM).stream("H3")
    assert caught.value.remedy == "Capitals count: write h3."


def test_the_example_of_a_new_workspace_is_right(tmp_path: Path) -> None:
    text = default_config().read_text()
    begin = text.index("# [[stream]]")
    lines = text[begin : text.index("\n\n", begin)].splitlines()
    example = "\n".join(line.removeprefix("# ") for line in lines)
    assert [stream.name for stream in bridge(tmp_path, example).streams] == ["h3"]


FEED = STREAM.replace(
    "sampling_rate_hz",
    """kind = "seedlink"
server = "logger.example.org:18001"
channels = ["XX_HGR3__HN1"]
calibration = [2e-6]
sampling_rate_hz""",
)


def test_stream_of_seedlink(tmp_path: Path) -> None:
    (found,) = bridge(tmp_path, FEED).streams
    ids = (("XX", "HGR3", "", "HN1"),)
    assert found.feed == SeedLinkFeed("logger.example.org", 18001, ids, (2e-6,))
    (plain,) = bridge(tmp_path, FEED.replace(":18001", "")).streams
    assert plain.feed is not None
    assert plain.feed.port == 18000


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ('"seedlink"', '"earthworm"', "kind = 'earthworm' is not known"),
        ("logger.example.org:18001", "http://logger", "is no host and port"),
        ('["XX_HGR3__HN1"]', '["XX_HGR3__HN1", "XX_HGR3__HN2"]', "is not one for each of the 1 "),
        ("XX_HGR3__HN1", "HGR3.HN1", "is not one for each of the 1 "),
        ("[2e-6]", "[0]", r"calibration = \[0\] is not one for each"),
        ("calibration = [2e-6]", "", "calibration is missing"),
        ('kind = "seedlink"', "", "unknown key"),
    ],
)
def test_stream_of_seedlink_refuses(tmp_path: Path, was: str, becomes: str, said: str) -> None:
    with pytest.raises(BadInput, match=said):
        bridge(tmp_path, FEED.replace(was, becomes))


def test_stream_of_seedlink_remedy_fits_channels(tmp_path: Path) -> None:
    second = '[[stream.channel]]\nname = "second"\nplane = "transverse"\nx_m = 1.0\n'
    ids = '["XX_HGR3__HN1", "XX_HGR3__HN2"]'
    text = FEED.replace('["XX_HGR3__HN1"]', ids) + "\n" + second
    with pytest.raises(BadInput, match="one for each of the 2") as refusal:
        bridge(tmp_path, text)
    assert "calibration = [2.4e-6, 2.4e-6]" in refusal.value.remedy
    assert bridge(tmp_path, text.replace("[2e-6]", "[2e-6, 2e-6]")).streams
