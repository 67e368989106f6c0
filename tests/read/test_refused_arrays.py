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

from shm.errors import BadInput
from shm.read import peek, read
from shm.read.limits import Limits, limited
from shm.read.matlab_file import elements_of
from tests.helpers.written import refused

SERIES = np.random.default_rng(8).standard_normal(200)
HUGE = 400_000_000  # values: 3 GB
savemat: Any = scipy.io.savemat


class Trap:
    """Unpickling it would write a file."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.target,))


def assert_refused(path: Path, words: str) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused(path, words, read, peek)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 100_000, "kB of memory were taken before the refusal"


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_python_objects_are_never_unpickled(tmp_path: Path, suffix: str) -> None:
    path, target = tmp_path / f"test{suffix}", tmp_path / "sprung"
    trap = np.array([Trap(target)] * 20, dtype=object)
    if suffix == ".npy":
        np.save(path, trap, allow_pickle=True)
    else:
        np.savez(path, acc_1=trap)
    assert_refused(path, "Python objects, which are never unpickled")
    assert not target.exists()


def test_a_pickle_in_numpys_clothes_is_refused(tmp_path: Path) -> None:
    path, target = tmp_path / "test.npy", tmp_path / "sprung"
    path.write_bytes(pickle.dumps(Trap(target)))
    assert_refused(path, "does not hold what its name says")
    (tmp_path / "test.npz").write_bytes(path.read_bytes())
    assert_refused(tmp_path / "test.npz", "does not hold what its name says")
    assert not target.exists()


def npy_header(shape: tuple[int, ...]) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return stream.getvalue()


@pytest.mark.parametrize("shape", [(HUGE,), (2, HUGE), (2**62, 4), (1 << 70,), (-5,), (-5, -9)])
def test_a_numpy_header_that_claims_too_much_is_refused(
    tmp_path: Path, shape: tuple[int, ...]
) -> None:
    path = tmp_path / "test.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("acc_1.npy", npy_header(shape))
    assert_refused(path, "beyond the 256 MB|cannot be read")


def test_a_numpy_header_that_claims_more_than_there_is_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "test.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("acc_1.npy", npy_header((200,)) + bytes(8 * 150))
        archive.writestr("fs.npy", npy_header(()) + struct.pack("<d", 512))
    refused(path, "'acc_1' cannot be read")


def h5(folder: Path, make: Callable[[h5py.File], object], name: str = "test.h5") -> Path:
    path = folder / name
    with h5py.File(path, "w") as file:
        file.attrs["fs"] = 512
        make(file)
    return path


def test_an_hdf5_dataset_far_larger_than_its_file_is_refused(tmp_path: Path) -> None:
    path = h5(tmp_path, lambda f: f.create_dataset("acc_1", (HUGE,), "f8", chunks=(1000,)))
    assert path.stat().st_size < 10_000
    assert_refused(path, "acc_1: holds 400000000 values, beyond the 256 MB")


def test_an_hdf5_chunk_far_larger_than_its_dataset_is_refused(tmp_path: Path) -> None:
    path = h5(
        tmp_path,
        lambda f: f.create_dataset("acc_1", (200,), "f8", maxshape=(None,), chunks=(HUGE,)),
    )
    assert_refused(path, "beyond the 256 MB")


def test_an_hdf5_dataset_that_stands_in_another_file_is_refused(tmp_path: Path) -> None:
    secret = tmp_path / "secret.bin"
    secret.write_bytes(SERIES.tobytes())
    outside = [(str(secret), 0, 1600)]
    path = h5(tmp_path, lambda f: f.create_dataset("acc_1", (200,), "f8", external=outside))
    assert_refused(path, "acc_1 takes its data from other files")


def test_a_virtual_hdf5_dataset_is_refused(tmp_path: Path) -> None:
    source = h5(tmp_path, lambda f: f.create_dataset("acc_1", data=SERIES), "source.h5")
    layout = h5py.VirtualLayout((200,), "f8")
    layout[:] = h5py.VirtualSource(str(source), "acc_1", (200,))
    path = h5(tmp_path, lambda f: f.create_virtual_dataset("acc_1", layout))
    assert_refused(path, "acc_1 takes its data from other files")


@pytest.mark.parametrize("link", [h5py.SoftLink("/acc_1"), h5py.ExternalLink("x.h5", "/acc_1")])
def test_links_of_hdf5_are_refused(tmp_path: Path, link: object) -> None:
    def make(file: h5py.File) -> None:
        file["acc_1"] = SERIES
        file["sub/acc_2"] = link

    assert_refused(h5(tmp_path, make), "sub/acc_2 is a soft or an external link")


def test_a_group_that_holds_itself_ends(tmp_path: Path) -> None:
    def make(file: h5py.File) -> None:
        file["acc_1"] = SERIES
        file["ring"] = file["/"]

    assert_refused(h5(tmp_path, make), "more objects than a recording can have")


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
    assert len(read(path).channels) == 1  # type: ignore[union-attr]


def test_a_compression_that_needs_a_plug_in_is_refused(tmp_path: Path) -> None:
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((200,))
    made.set_filter(32015, h5py.h5z.FLAG_OPTIONAL)  # Zstandard

    def make(file: h5py.File) -> None:
        space = h5py.h5s.create_simple((200,))
        h5py.h5d.create(file.id, b"acc_1", h5py.h5t.IEEE_F64LE, space, dcpl=made)

    assert_refused(h5(tmp_path, make), "compressed in a way that is not read")


def mat(folder: Path, *, pack: bool = False, **arrays: Any) -> Path:
    path = folder / "test.mat"
    savemat(path, {"fs": 512.0, **arrays}, do_compression=pack)
    return path


def test_matlab_functions_and_objects_are_left_out_unread(tmp_path: Path) -> None:
    """An object as scipy writes it, from a structured array with a class name."""
    thing = scipy.io.matlab.MatlabObject(np.zeros((1, 1), [("a", "O")]), "handle")
    path = mat(tmp_path, acc_1=SERIES, acc_1_unit="m/s2", thing=thing)
    assert peek(path).left_out == ("thing (object)",)
    assert len(read(path).channels) == 1  # type: ignore[union-attr]


def test_a_matlab_shape_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    path = mat(tmp_path, acc_1=SERIES)
    content = path.read_bytes()
    shape = struct.pack("<II", 1, 200)
    assert content.count(shape) == 1
    path.write_bytes(content.replace(shape, struct.pack("<II", 1, HUGE)))
    assert_refused(path, "acc_1: holds 1x400000000 values, beyond the 256 MB")


def test_a_compressed_matlab_variable_that_unpacks_too_far_is_refused(tmp_path: Path) -> None:
    path = mat(tmp_path, acc_1=np.zeros(3_000_000), pack=True)
    assert path.stat().st_size < 40_000
    claim_less_in_packed(path, struct.pack("<II", 1, 3_000_000), struct.pack("<II", 1, 300))
    few = limited(Limits(parse_memory_bytes=4 * 2**22))
    with few, pytest.raises(BadInput, match="'acc_1' cannot be read"):
        read(path)


def claim_less_in_packed(path: Path, said: bytes, claimed: bytes) -> None:
    """Change the shape of the last variable of a file, within what is compressed."""
    head, *_, element = path.read_bytes()[:128], *elements_of(path.read_bytes())
    whole = zlib.decompress(element.content)
    assert whole.count(said) == 1
    packed = zlib.compress(whole.replace(said, claimed))
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


@pytest.mark.parametrize("kind", [0, 8, 14, 15, 99, 2057])
def test_an_unknown_type_of_matlab_is_refused(tmp_path: Path, kind: int) -> None:
    """With type 2057 in place of 9, scipy.io.loadmat ends the process."""
    path = mat(tmp_path, acc_1=SERIES)
    content = path.read_bytes()
    tag = struct.pack("<II", 9, 1600)
    assert content.count(tag) == 1
    path.write_bytes(content.replace(tag, struct.pack("<II", kind, 1600)))
    refused(path, "'acc_1' cannot be read")


def test_a_variable_that_stands_twice_is_refused(tmp_path: Path) -> None:
    path = mat(tmp_path, acc_1=SERIES)
    content = path.read_bytes()
    path.write_bytes(content + content[128:])
    assert_refused(path, "stands twice in the file")


def test_version_4_of_matlab_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "test.mat"
    savemat(path, {"acc_1": SERIES}, format="4")
    assert_refused(path, "does not hold what its name says, not MATLAB")


def tdms(folder: Path) -> Path:
    path = folder / "test.tdms"
    said = {"unit_string": "g", "wf_increment": 0.01}
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([ChannelObject("Log", "a", SERIES, said)])
    return path


def test_a_tdms_file_that_a_logger_has_not_closed_is_refused(tmp_path: Path) -> None:
    path = tdms(tmp_path)
    path.write_bytes(path.read_bytes()[:-100])
    assert_refused(path, "the file ends within its data")


def test_a_tdms_index_beside_the_file_is_not_believed(tmp_path: Path) -> None:
    path = tdms(tmp_path)
    path.with_name("test.tdms_index").write_bytes(b"TDSh" + bytes(100))
    assert peek(path).problems == ()


def test_a_tdms_header_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    path = tdms(tmp_path)
    content = path.read_bytes()
    length = struct.pack("<IQ", 1, 200)
    assert content.count(length) == 1
    path.write_bytes(content.replace(length, struct.pack("<IQ", 1, HUGE)))
    assert_refused(path, "ends within its data|more than the file has bytes")


@pytest.mark.parametrize("suffix", [".csv", ".uff", ".csv.gz", ".mat"])
def test_a_file_beyond_what_is_read_at_once_is_refused(tmp_path: Path, suffix: str) -> None:
    starts = {".mat": mat(tmp_path, acc_1=SERIES).read_bytes(), ".uff": b"    -1\n    58\n"}
    content = starts.get(suffix, b"# sampling_rate_hz: 1\nforce,acc_1\n") + b"1,2\n" * 300_000
    path = tmp_path / f"test{suffix}"
    path.write_bytes(gzip.compress(content) if suffix.endswith(".gz") else content)
    with limited(Limits(parse_memory_bytes=4 * 2**20)):
        assert_refused(path, "more than the 1 MB that are read at once")
