"""The audio interface against a stand-in for the library `sounddevice`: it needs no hardware."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shm.acquire import DeviceLost, SoundCard
from shm.errors import BadInput


class PortAudioError(Exception):
    """The error of the library."""


class Library(SimpleNamespace):
    """What `sounddevice` offers of one interface with two inputs, "Scarlett".

    `blocks` are what it calls back with once started: samples, and whether some were lost before.
    """

    PortAudioError = PortAudioError

    def __init__(self, *blocks: tuple[int, bool]) -> None:
        super().__init__(blocks=blocks, closed=False)

    def query_devices(self) -> list[dict[str, Any]]:
        return [{"name": "Scarlett", "max_input_channels": 2},
                {"name": "HDMI", "max_input_channels": 0}]  # fmt: skip

    def InputStream(  # noqa: N802
        self, device: str | int, channels: int, callback: Callable[..., None]
    ) -> Any:
        if device not in (0, "Scarlett") or channels > 2:
            raise PortAudioError("Invalid device")

        def start() -> None:
            count = 0
            for samples, lost in self.blocks:
                data = np.arange(count, count + samples, dtype=np.float32)[:, None]
                callback(np.repeat(data, channels, axis=1), samples, None,
                         SimpleNamespace(input_overflow=lost))  # fmt: skip
                count += samples

        def close(ignore_errors: bool) -> None:
            self.closed = True

        return SimpleNamespace(samplerate=48000, start=start, close=close)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Library]:
    def install(*blocks: tuple[int, bool]) -> Library:
        library = Library(*blocks)
        monkeypatch.setitem(sys.modules, "sounddevice", library)
        return library

    return install


def test_sound_card_reads_across_blocks(installed: Callable[..., Library]) -> None:
    library = installed((7, False), (5, False))

    card = SoundCard("Scarlett", 2)
    first, second = card.read(4), card.read(8)
    card.close()

    assert card.sampling_rate_hz == 48000.0
    assert first.shape == (2, 4)
    np.testing.assert_array_equal(np.concatenate([first, second], axis=1)[1], np.arange(12))
    assert library.closed


def test_sound_card_marks_lost_samples(installed: Callable[..., Library]) -> None:
    installed((4, False), (4, True))

    block = SoundCard("0", 2).read(8)

    assert np.flatnonzero(np.isnan(block[0])).tolist() == [4]


def test_sound_card_gone(installed: Callable[..., Library]) -> None:
    installed((4, False))
    card = SoundCard("Scarlett", 2, patience_s=0.01)

    with pytest.raises(DeviceLost, match="has gone"):
        card.read(8)


@pytest.mark.parametrize(("name", "channels"), [("Focus", 2), ("Scarlett", 3)])
def test_sound_card_lists_devices(
    installed: Callable[..., Library], name: str, channels: int
) -> None:
    installed()

    with pytest.raises(BadInput, match=name) as refused:
        SoundCard(name, channels)

    assert ("Scarlett" in refused.value.remedy) == (channels == 2)


def test_sound_card_without_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sounddevice", None)

    with pytest.raises(BadInput, match="no audio interface") as refused:
        SoundCard("0", 2)

    assert "shm[audio]" in refused.value.remedy
