"""Files made to harm: they are refused by their headers, before anything is opened or allocated."""

from __future__ import annotations

import gzip
import io
import pickle
import resource
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from shm.read import peek, read
from shm.read.limits import Limits, limited
from shm.read.matlab_file import elements_of
from tests.helpers.written import recorded, refused

SERIES = np.random.default_rng(8).standard_normal(200)
HUGE = 400_000_000  # values: 3 GB
savemat: Any = scipy.io.savemat


class Trap:
    """Unpickling it would write a file."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.target,))


def objects(folder: Path, suffix: str) -> Path:
    path, trap = folder / f"test{suffix}", np.array([Trap(folder / "sprung")] * 20, dtype=object)
    if suffix == ".npy":
        np.save(path, trap, allow_pickle=True)
    else:
        np.savez(path, acc_1=trap)
    return path


def pickled(folder: Path, suffix: str) -> Path:
    path = folder / f"test{suffix}"
    path.write_bytes(pickle.dumps(Trap(folder / "sprung")))
    return path


def npy_header(shape: tuple[int, ...]) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return stream.getvalue()


def npz(folder: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(folder / "test.npz", "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return folder / "test.npz"


def h5(folder: Path, make: Callable[[h5py.File], object], name: str = "test.h5") -> Path:
    path = folder / name
    with h5py.File(path, "w") as file:
        file.attrs["fs"] = 512
        make(file)
    return path


def small_h5_of_much(folder: Path) -> Path:
    path = h5(folder, lambda f: f.create_dataset("acc_1", (HUGE,), "f8", chunks=(1000,)))
    assert path.stat().st_size < 10_000
    return path


def h5_of_another_file(folder: Path) -> Path:
    (folder / "secret.bin").write_bytes(SERIES.tobytes())
    outside = [(str(folder / "secret.bin"), 0, 1600)]
    return h5(folder, lambda f: f.create_dataset("acc_1", (200,), "f8", external=outside))


def virtual_h5(folder: Path) -> Path:
    source = h5(folder, lambda f: f.create_dataset("acc_1", data=SERIES), "source.h5")
    layout = h5py.VirtualLayout((200,), "f8")
    layout[:] = h5py.VirtualSource(str(source), "acc_1", (200,))
    return h5(folder, lambda f: f.create_virtual_dataset("acc_1", layout))


def h5_with(place: str, link: object) -> Callable[[Path], Path]:
    return lambda folder: h5(folder, lambda f: f.update({"acc_1": SERIES}) or f.update(
        {place: f["/"] if link is None else link}
    ))  # fmt: skip


def h5_that_needs_a_plug_in(folder: Path) -> Path:
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((200,))
    made.set_filter(32015, h5py.h5z.FLAG_OPTIONAL)  # Zstandard

    def make(file: h5py.File) -> None:
        space = h5py.h5s.create_simple((200,))
        h5py.h5d.create(file.id, b"acc_1", h5py.h5t.IEEE_F64LE, space, dcpl=made)

    return h5(folder, make)


def mat(folder: Path, *, pack: bool = False, version: str = "5", **arrays: Any) -> Path:
    path = folder / "test.mat"
    arrays = {"acc_1": SERIES, **arrays}
    savemat(path, {"fs": 512.0, **arrays}, do_compression=pack, format=version)
    return path


def tdms(folder: Path) -> Path:
    path = folder / "test.tdms"
    said = {"unit_string": "g", "wf_increment": 0.01}
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([ChannelObject("Log", "a", SERIES, said)])
    return path


def claiming(path: Path, said: bytes, claimed: bytes) -> Path:
    """Return the file with what it says once of itself changed."""
    content = path.read_bytes()
    assert content.count(said) == 1
    path.write_bytes(content.replace(said, claimed))
    return path


def with_bytes(path: Path, change: Callable[[bytes], bytes]) -> Path:
    path.write_bytes(change(path.read_bytes()))
    return path


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    **{
        f"objects in {suffix}": (lambda f, s=suffix: objects(f, s), "which are never unpickled")
        for suffix in (".npy", ".npz")
    },
    **{
        f"a pickle in {suffix}": (lambda f, s=suffix: pickled(f, s), "does not hold what its name")
        for suffix in (".npy", ".npz")
    },
    **{
        f"npy of {n}": (lambda f, s=s: npz(f, acc_1=npy_header(s)), "beyond the 256 MB|be read")
        for n, s in enumerate([(HUGE,), (2, HUGE), (2**62, 4), (1 << 70,), (-5,), (-5, -9)])
    },
    "h5 larger than its file": (
        small_h5_of_much, "acc_1: holds 400000000 values, beyond the 256 MB",
    ),
    "h5 of a chunk larger than its dataset": (
        lambda f: h5(f, lambda file: file.create_dataset(
            "acc_1", (200,), "f8", maxshape=(None,), chunks=(HUGE,)
        )), "beyond the 256 MB",
    ),
    "h5 of another file": (h5_of_another_file, "acc_1 takes its data from other files"),
    "virtual h5": (virtual_h5, "acc_1 takes its data from other files"),
    "h5 with a soft link": (
        h5_with("sub/acc_2", h5py.SoftLink("/acc_1")), "sub/acc_2 is a soft or an external link",
    ),
    "h5 with a link outside": (
        h5_with("sub/acc_2", h5py.ExternalLink("x.h5", "/acc_1")),
        "sub/acc_2 is a soft or an external link",
    ),
    "h5 whose group holds itself": (
        h5_with("ring", None), "more objects than a recording can have",
    ),
    "h5 that needs a plug-in": (h5_that_needs_a_plug_in, "compressed in a way that is not read"),
    "mat of a shape too large": (
        lambda f: claiming(mat(f), struct.pack("<II", 1, 200), struct.pack("<II", 1, HUGE)),
        "acc_1: holds 1x400000000 values, beyond the 256 MB",
    ),
    "mat with a variable twice": (
        lambda f: with_bytes(mat(f), lambda b: b + b[128:]), "occurs twice in the file",
    ),
    "mat of version 4": (
        lambda f: mat(f, version="4"), "does not hold what its name says, not MATLAB",
    ),
    "tdms that was not closed": (
        lambda f: with_bytes(tdms(f), lambda b: b[:-100]), "the file ends within its data",
    ),
    "tdms of a length too large": (
        lambda f: claiming(tdms(f), struct.pack("<IQ", 1, 200), struct.pack("<IQ", 1, HUGE)),
        "ends within its data|more than the file has bytes",
    ),
}  # fmt: skip


def assert_refused(path: Path, words: str) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused(path, words, read, peek)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 100_000, "kB of memory were taken before the refusal"


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_made_to_harm_is_refused_by_its_header(tmp_path: Path, name: str) -> None:
    make, words = REFUSED[name]
    assert_refused(make(tmp_path), words)
    assert not (tmp_path / "sprung").exists()


def test_a_numpy_header_that_claims_more_than_there_is_is_refused(tmp_path: Path) -> None:
    acc, fs = npy_header((200,)) + bytes(8 * 150), npy_header(()) + struct.pack("<d", 512)
    refused(npz(tmp_path, acc_1=acc, fs=fs), "'acc_1' cannot be read")


def test_references_and_lists_of_hdf5_are_left_out_unread(tmp_path: Path) -> None:
    def make(file: h5py.File) -> None:
        file["acc_1"] = SERIES
        file["acc_1"].attrs["unit"] = "m/s2"
        file.create_dataset("points", (30,), h5py.ref_dtype)
        file.create_dataset("lists", (30,), h5py.vlen_dtype("f8"))
        file.create_dataset("rows", (30,), [("a", "f8"), ("b", "i4")])
        file.attrs.create("many", np.zeros(5000))
        file.attrs.create("at", file["acc_1"].ref, dtype=h5py.ref_dtype)

    path = h5(tmp_path, make)
    assert peek(path).left_out == ("lists", "points", "rows")
    assert len(recorded(path).channels) == 1


def test_matlab_functions_and_objects_are_left_out_unread(tmp_path: Path) -> None:
    """An object as scipy writes it, from a structured array with a class name."""
    thing = scipy.io.matlab.MatlabObject(np.zeros((1, 1), [("a", "O")]), "handle")
    path = mat(tmp_path, acc_1_unit="m/s2", thing=thing)
    assert peek(path).left_out == ("thing (object)",)
    assert len(recorded(path).channels) == 1


def test_a_compressed_matlab_variable_that_unpacks_too_far_is_refused(tmp_path: Path) -> None:
    """The shape of its last variable is changed within what is compressed."""
    path = mat(tmp_path, acc_1=np.zeros(3_000_000), pack=True)
    assert path.stat().st_size < 40_000
    head, *_, element = path.read_bytes()[:128], *elements_of(path.read_bytes())
    whole, said = zlib.decompress(element.content), struct.pack("<II", 1, 3_000_000)
    assert whole.count(said) == 1
    packed = zlib.compress(whole.replace(said, struct.pack("<II", 1, 300)))
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with limited(Limits(parse_memory_bytes=4 * 2**22)):
        refused(path, "'acc_1' cannot be read")


@pytest.mark.parametrize("kind", [0, 8, 14, 15, 99, 2057])
def test_an_unknown_type_of_matlab_is_refused(tmp_path: Path, kind: int) -> None:
    """With type 2057 in place of 9, scipy.io.loadmat ends the process."""
    path = claiming(mat(tmp_path), struct.pack("<II", 9, 1600), struct.pack("<II", kind, 1600))
    refused(path, "'acc_1' cannot be read")


def test_a_tdms_index_beside_the_file_is_not_believed(tmp_path: Path) -> None:
    path = tdms(tmp_path)
    path.with_name("test.tdms_index").write_bytes(b"TDSh" + bytes(100))
    assert peek(path).problems == ()


@pytest.mark.parametrize("suffix", [".csv", ".uff", ".csv.gz", ".mat"])
def test_a_file_beyond_what_is_read_at_once_is_refused(tmp_path: Path, suffix: str) -> None:
    starts = {".mat": mat(tmp_path).read_bytes(), ".uff": b"    -1\n    58\n"}
    content = starts.get(suffix, b"# sampling_rate_hz: 1\nforce,acc_1\n") + b"1,2\n" * 300_000
    path = tmp_path / f"test{suffix}"
    path.write_bytes(gzip.compress(content) if suffix.endswith(".gz") else content)
    with limited(Limits(parse_memory_bytes=4 * 2**20)):
        assert_refused(path, "more than the 1 MB that are read at once")
