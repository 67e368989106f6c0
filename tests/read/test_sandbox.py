"""Reading in a child: the same values, and whatever a file does to the child stays there."""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shm.documents import dump
from shm.errors import BadInput, ShmError, WorkerDied
from shm.modes_document import load_modes as load_modes_here
from shm.modes_document import modes_document
from shm.read import FORMATS, Format, bundle, peek_test, read_test, sandbox
from shm.read.sandbox import reading_process
from shm.values import FrequencyResponse, ModalTest, Mode, Recording
from tests.helpers.comparing import assert_same
from tests.helpers.taken_over import obey, obeying_readers
from tests.helpers.written import write

formats = pytest.mark.parametrize(
    "file_format", [known for known in FORMATS if known.names_channels], ids=lambda f: f.name
)
Child = Callable[..., object]
QUICK, SMALL = sandbox.Limits(parse_seconds=0.3), sandbox.Limits(parse_memory_bytes=2**26)


def written(recording: Recording | FrequencyResponse, path: Path) -> Path:
    write(recording, path)
    return path


@pytest.fixture
def csv(recording: Recording, tmp_path: Path) -> Path:
    return written(recording, tmp_path / "test.csv")


@pytest.fixture(scope="module", autouse=True)
def reading_process_that_obeys() -> Iterator[None]:
    with obeying_readers():
        yield


@pytest.fixture
def child(tmp_path: Path) -> Child:
    """Lets a child run some code, which may leave what it has `found`."""

    def does(code: str, limits: sandbox.Limits | None = None) -> object:
        return obey(tmp_path / "trap.py", code, limits)

    return does


@formats
def test_a_recording_read_apart_is_the_one_read_here(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(recording, tmp_path / f"test{file_format.suffixes[0]}")
    (here,), (there,) = read_test(path), sandbox.read_test(path)
    assert isinstance(here, Recording)
    assert isinstance(there, Recording)
    assert_same(there, here)
    assert all(channel.values.flags.writeable for channel in there.channels)
    assert_same(sandbox.peek_test(path), peek_test(path))


def test_frequency_responses_and_tests_of_several_files_come_back_whole(
    response: FrequencyResponse, recording: Recording, tmp_path: Path
) -> None:
    one, other = written(response, tmp_path / "a.h5"), written(recording, tmp_path / "b.csv")
    archive = bundle([one, other], tmp_path / "test.zip")
    found, second = sandbox.read_test(archive)
    assert isinstance(found, FrequencyResponse)
    assert isinstance(second, Recording)
    np.testing.assert_array_equal(found.accelerance, response.accelerance)
    assert found.coherence is not None
    assert (found.points, found.time) == (response.points, response.time)
    assert [look.source for look in sandbox.peek_test(archive)] == [found.source, second.source]


def test_modal_tests_come_back_as_the_document_has_them(tmp_path: Path) -> None:
    path = tmp_path / "some.modes.json"
    tests = (ModalTest("t1", (Mode("transverse", 1, 5.8, 0.006),), hanger=3),)
    path.write_text(dump(modes_document(tests)))
    assert_same(sandbox.load_modes(path), load_modes_here(path))


def test_a_refusal_keeps_file_line_channel_and_remedy(tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    path.write_text("# sampling_rate_hz: 512\nforce,acc_1\n1,2\n1,two\n")
    with pytest.raises(BadInput) as here:
        read_test(path)
    with pytest.raises(BadInput) as there:
        sandbox.read_test(path)
    assert vars(there.value) == vars(here.value)
    assert there.value.line == 4


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("os.abort()", r"made the reader crash \(SIGABRT\)"),
        ("import ctypes; ctypes.string_at(8)", r"made the reader crash \(SIGSEGV\)"),
        ("os._exit(3)", r"made the reader crash \(exit code 3\)"),
        ("while True: pass", "takes more than 0.3 s"),
        ("import time; time.sleep(60)", "takes more than 0.3 s"),
        ("bytearray(2**31)", "needs more memory"),
        ("[bytearray(2**20) for _ in range(200)]", "needs more memory"),
        ("raise KeyError('shape')", "cannot be read .KeyError"),
    ],
)
def test_a_child_that_dies_hangs_or_grows_is_a_refusal_and_the_next_file_is_read(
    child: Child, code: str, words: str, csv: Path
) -> None:
    with pytest.raises(BadInput, match=words) as refusal:
        child(code, QUICK if "takes" in words else SMALL)
    assert Path(refusal.value.file).name == "trap.py"
    assert refusal.value.remedy
    assert len(sandbox.read_test(csv)) == 1


def test_a_child_has_its_limits_no_environment_and_no_file_but_its_answer(child: Child) -> None:
    """No core, its seconds, no file that grows, few open at a time, so much memory."""
    code = """
import resource
limits = [resource.getrlimit(getattr(resource, 'RLIMIT_' + name))
          for name in ('CORE', 'NOFILE', 'FSIZE', 'NPROC')]
seconds, most = resource.getrlimit(resource.RLIMIT_CPU)
memory, same = resource.getrlimit(resource.RLIMIT_AS)
nowhere = [os.fstat(k).st_rdev == os.stat('/dev/null').st_rdev for k in (0, 1, 2)]
open_files = 0
for k in range(3, 1500):
    try:
        os.fstat(k)
        open_files += 1
    except OSError:
        pass
has_path = 'PATH' in os.environ
raise KeyError(limits, most - seconds, memory == same > 0, nowhere, open_files, has_path)
"""
    expected = "([(0, 0), (64, 64), (0, 0), (0, 0)], 1, True, [True, True, True], 1, False)"
    with pytest.raises(BadInput, match=re.escape(f"KeyError: {expected}")):
        child(code)


def test_a_child_writes_no_content_beside_its_file(child: Child, csv: Path) -> None:
    with pytest.raises(BadInput, match=r"SIGXFSZ|File too large"):
        child("file = open(path.parent / 'new', 'w'); file.write('x' * 9999); file.close()")
    assert not (csv.parent / "new").exists() or (csv.parent / "new").stat().st_size == 0


@pytest.mark.parametrize("unpacks", [True, False])
def test_where_a_limit_cannot_be_put_in_force_nothing_is_read_and_no_file_is_blamed(
    tmp_path: Path, unpacks: bool
) -> None:
    broken = "serving.resource.setrlimit = lambda *_: 1 / 0"
    with obeying_readers(broken), pytest.raises(ShmError, match="cannot be confined") as refusal:
        obey(tmp_path / ("trap.py.gz" if unpacks else "trap.py"), "found = 'it succeeded'")
    assert not isinstance(refusal.value, BadInput)
    assert refusal.value.retry_after_s


FOUND = """
from dataclasses import replace
from shm.values import Channel, Recording
import numpy as np
first = Channel('force', 'force', np.ones(200))
others = [Channel(name, 'acceleration', np.ones(200)) for name in ('acc_1', 'acc_2')]
found = (replace(Recording(str(path), (first, *others), 512.0), {}),)
"""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("hanger=True", "not a whole number"),
        ("channels=(replace(first, values=first.values * 1j), *others)", "another type"),
        ("channels=(replace(first, plane='sideways'), *others)", "is not one of transverse"),
        ("channels='abc'", "not a list"),
        ("temperature_c='warm'", "is not a number"),
        ("time='once'", "time"),
    ],
)
def test_an_answer_of_other_types_is_a_refusal(child: Child, change: str, words: str) -> None:
    with pytest.raises(BadInput, match=f"an answer that cannot be.*{words}"):
        child(FOUND.format(change))


def packed(header: bytes, **arrays: Any) -> bytes:
    """Return an answer as a reader that was taken over might write it."""
    stream = io.BytesIO()
    np.savez(stream, header=np.frombuffer(header, np.uint8), **arrays)
    return stream.getvalue()


@pytest.mark.parametrize(
    "said",
    [
        b"", b"hello", packed(b"3"), packed(b"[" * 100_000), packed(b"[3]"),
        packed(b"[]")[:-30], pickle.dumps(print),
        packed(b"[]", a=np.array([{}], dtype=object)),
    ],
)  # fmt: skip
def test_an_answer_that_is_none_is_a_refusal(child: Child, said: bytes) -> None:
    code = f"""
        out = next(n for n in range(3, 1000) if os.path.exists(f'/proc/self/fd/{{n}}'))
        os.write(out, {said!r})
        os._exit(0)
        """
    with pytest.raises(BadInput, match=r"made the reader crash \(exit code 0\)"):
        child(code)


def test_numbers_and_arrays_of_other_types_are_widened_or_refused(child: Child) -> None:
    change = "channels=(replace(first, values=first.values.astype('f4')), *others)"
    assert child(FOUND.format(change))
    code = FOUND.format("hanger=np.int64(3), temperature_c=np.float32(4)")
    ((found,),) = (child(code),)  # type: ignore[misc]
    assert (found.hanger, found.temperature_c) == (3, 4.0)


def test_a_refusal_has_its_texts_cut_and_readable(child: Child) -> None:
    code = """
from shm.errors import BadInput
raise BadInput('a\\x00b' + 'x' * 3000, file=path, channel='y' * 600, remedy='Do\\x1b.')
"""
    with pytest.raises(BadInput) as refusal:
        child(code)
    told = refusal.value
    assert told.message.startswith("a?bxxx")
    assert (len(told.message) <= 2001, len(told.channel), told.remedy) == (True, 500, "Do?.")


def test_limits_are_those_that_are_given(csv: Path) -> None:
    for few, words in (
        ({"max_channels": 1}, "2 accelerations; at most 1"),
        ({"max_samples": 100}, "200 samples are more than the 100 of setting max_samples"),
        ({"max_header_bytes": 20}, "more than the 20 of setting max_header_bytes"),
        ({"parse_memory_bytes": 4000}, "more than the 0 MB|needs more memory|reader crash"),
    ):
        with pytest.raises(BadInput, match=words):
            sandbox.read_test(csv, sandbox.Limits(**few))  # type: ignore[arg-type]


def test_what_is_unpacked_goes_even_where_the_child_dies(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = tmp_path / "packed"
    packed.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(packed))
    archive = bundle([written(recording, tmp_path / "a.csv")], tmp_path / "test.zip")
    assert sandbox.read_test(archive)
    with pytest.raises(BadInput, match="takes more than"):
        sandbox.read_test(archive, sandbox.Limits(parse_seconds=0.001))
    assert list(packed.iterdir()) == []


def test_it_reads_from_threads_from_forks_and_from_daemonic_processes(csv: Path) -> None:
    with ThreadPoolExecutor(4) as threads:
        assert all(len(found) == 1 for found in threads.map(sandbox.read_test, [csv] * 8))
    for context in (multiprocessing.get_context("fork"), multiprocessing.get_context("spawn")):
        process = context.Process(target=sandbox.read_test, args=(csv,), daemon=True)
        process.start()
        process.join(60)
        assert process.exitcode == 0
    assert sandbox.read_test(csv)


def test_a_reading_process_killed_while_it_reads_is_begun_anew(csv: Path) -> None:
    sandbox.read_test(csv)
    reader = reading_process._known[0].process.pid
    os.kill(reader, signal.SIGSTOP)  # so that it cannot answer before it is killed
    threading.Timer(0.2, os.kill, (reader, signal.SIGKILL)).start()
    with pytest.raises(WorkerDied, match="SIGKILL"):  # not the file's doing
        sandbox.read_test(csv)
    assert sandbox.read_test(csv)


@pytest.mark.parametrize("known_to_be_dead", [True, False])
def test_a_reading_process_killed_before_it_is_asked_costs_no_file(
    csv: Path, monkeypatch: pytest.MonkeyPatch, known_to_be_dead: bool
) -> None:
    sandbox.read_test(csv)
    process = reading_process._known[0].process
    os.kill(process.pid, signal.SIGKILL)
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    if not known_to_be_dead:
        polls = iter([lambda: None])
        polled = process.poll
        monkeypatch.setattr(process, "poll", lambda: next(polls, polled)())
    assert sandbox.read_test(csv)
    assert reading_process._known[0].process.pid != process.pid


def test_the_reading_process_ends_with_the_one_that_asks(csv: Path) -> None:
    code = (
        f"import sys, time; sys.path[:] = {sys.path!r}\nfrom pathlib import Path\n"
        "from shm.read.sandbox import read_test, reading_process\n"
        f"read_test(Path({str(csv)!r})); print(reading_process._known[0].process.pid, flush=True)\n"
        "time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process.stdout:
        reader = Path("/proc", process.stdout.readline().strip())
    assert reader.exists()
    process.kill()
    process.wait()
    deadline = time.monotonic() + 120
    while reader.exists() and "Z" not in (reader / "stat").read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)
