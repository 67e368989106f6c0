"""Files of all formats, whole, made to harm, and damaged at random; the same seed, the same files.

A sample is a file with its sidecar. Damage is of ten kinds: cut, bits, bytes, spliced, repeated,
noise, sizes (numbers that may be lengths become hostile ones), digits (the same in text), packed
(what is compressed is changed inside and packed again), sidecar.
"""

from __future__ import annotations

import gzip
import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from shm.documents import dump
from shm.modes_document import modes_document
from shm.read import bundle, sidecar_path
from shm.values import Channel, FrequencyResponse, ModalTest, Mode, Recording, ResponsePoint
from tests.helpers.written import write

SAMPLES = 200
_SIDECAR = b'hanger = 3\ntemperature_c = 12.0\n[channel.acc_1]\nplane = "transverse"\nx_m = 2.52\n'
_HOSTILE = (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1, 400_000_000, 65_535)
_HOSTILE_TEXT = (
    b"99999999999", b"-1", b"1e999", b"0", b"nan", b"4294967296", b"1e-320", b"0x7f", b"9" * 5000,
)  # fmt: skip
_LENGTHS = (SAMPLES, 8 * SAMPLES, 3, 24, 65, 130, 520, 1040, 1, 2, 16, 58, 8, 128, 512, 800)
savemat: Any = scipy.io.savemat


@dataclass(frozen=True)
class Sample:
    """A file to be read: the ending of its name, its content and that of its sidecar."""

    name: str
    suffix: str
    content: bytes
    sidecar: bytes = b""

    def lay(self, folder: Path, stem: str) -> Path:
        """Writes it, and its sidecar where it has one."""
        path = folder / f"{stem}{self.suffix}"
        path.write_bytes(self.content)
        if self.sidecar:
            sidecar_path(path).write_bytes(self.sidecar)
        return path


def a_recording(rng: np.random.Generator) -> Recording:
    force, first, second = rng.standard_normal((3, SAMPLES))
    channels = (
        Channel("force", "force", 800 * force, x_m=1.92),
        Channel("acc_1", "acceleration", first, "transverse", 2.52),
        Channel("acc_2", "acceleration", second, "longitudinal", 2.52),
    )
    return Recording("made", channels, 512.0, 3)


def a_response(rng: np.random.Generator) -> FrequencyResponse:
    real, imaginary = rng.standard_normal((2, 1, 65))
    frequency = 0.5 * np.arange(65)
    points = (ResponsePoint("low", "transverse", 2.5),)
    return FrequencyResponse("made", points, frequency, real + 1j * imaginary, hanger=3)


def whole_samples(folder: Path) -> list[Sample]:
    """A good file of each kind that is read."""
    rng = np.random.default_rng(1)
    folder.mkdir(exist_ok=True)
    found: list[Sample] = []
    for suffix in (".xlsx", ".wav", ".mseed", ".tob3"):
        path = folder / f"Recording{suffix}"
        write(a_recording(rng), path)
        beside = sidecar_path(path)
        sidecar = beside.read_bytes() if beside.is_file() else b""
        beside.unlink(missing_ok=True)
        found.append(Sample(path.name, suffix, path.read_bytes(), sidecar))
    for suffix in (".csv", ".uff", ".h5", ".mat", ".tdms", ".npz"):
        for made in (a_recording(rng), a_response(rng)):
            path = folder / f"{type(made).__name__}{suffix}"
            write(made, path)
            beside = sidecar_path(path)
            sidecar = beside.read_bytes() if beside.is_file() else b""
            found.append(Sample(path.name, suffix, path.read_bytes(), sidecar))
    recording, uff = found[4], found[6]
    archive = bundle([folder / "Recording.csv", folder / "Recording.npz"], folder / "test.zip")
    table = io.BytesIO()
    np.save(table, rng.standard_normal((3, SAMPLES)))
    rows = b'sampling_rate_hz = 512\n[channel.row_1]\nunit = "N"\n[channel.row_2]\nunit = "g"\n'
    units = b'[channel.force]\nunit = "N"\n[channel.acc_1]\nunit = "m/s2"\n'
    tests = [ModalTest("t1", (Mode("transverse", 1, 5.8, 0.006, 0.001, 0.0001),), hanger=3)]
    return [
        *found,
        replace(recording, name="with a sidecar", sidecar=_SIDECAR),
        Sample("gzipped csv", ".csv.gz", gzip.compress(recording.content, 1)),
        Sample("gzipped uff", ".uff.gz", gzip.compress(uff.content, 1)),
        Sample("test of two files", ".zip", archive.read_bytes()),
        Sample("packed npz", ".npz", _packed_npz(rng)),
        Sample("packed mat", ".mat", _packed_mat(rng, folder / "packed.mat")),
        Sample("packed hdf5", ".h5", _packed_hdf5(rng, folder / "packed.h5")),
        Sample("mat of a struct", ".mat", _struct_mat(rng, folder / "struct.mat")),
        Sample("labview", ".lvm", _labview(rng)),
        Sample("mat 7.3", ".mat", _mat_7_3(rng, folder / "new.mat"), units),
        Sample("npy", ".npy", table.getvalue(), rows),
        Sample("modal tests", ".modes.json", dump(modes_document(tests)).encode()),
    ]


def _packed_npz(rng: np.random.Generator) -> bytes:
    stream = io.BytesIO()
    arrays: dict[str, Any] = dict(zip(("force", "acc_1"), _rows(rng), strict=True))
    np.savez_compressed(stream, sampling_rate_hz=512.0, force_unit="N", acc_1_unit="g", **arrays)
    return stream.getvalue()


def _packed_mat(rng: np.random.Generator, path: Path) -> bytes:
    force, first = _rows(rng)
    units = {"force_unit": "N", "acc_1_unit": "m/s2"}
    savemat(path, {"force": force, "acc_1": first, "fs": 512.0, **units}, do_compression=True)
    return path.read_bytes()


def _struct_mat(rng: np.random.Generator, path: Path) -> bytes:
    force, first = _rows(rng)
    units = np.array(["N", "m/s2"], dtype=object)
    savemat(path, {"test": {"force": force, "acc_1": first, "fs": 512.0, "unit": units}})
    return path.read_bytes()


def _labview(rng: np.random.Generator) -> bytes:
    """Two hits, each under a heading of its own."""
    end = "***End_of_Header***"
    head = f"LabVIEW Measurement\t\nSeparator\tTab\nMulti_Headings\tYes\nX_Columns\tNo\n{end}\t\n"
    part = (
        "\t\nChannels\t2\t\nSamples\t200\t200\t\nDate\t2026/05/14\t2026/05/14\t\n"
        "Time\t10:12:40,5\t10:12:40,5\t\nY_Unit_Label\tN\tm/s^2\t\nX_Dimension\tTime\tTime\t\n"
        f"Delta_X\t0.002\t0.002\t\n{end}\t\t\nX_Value\tHammer\tAcc\tComment\n"
    )
    rows = "".join(f"\t{f:.4f}\t{a:.4f}\n" for f, a in zip(*_rows(rng), strict=True))
    return (head + 2 * (part + rows)).encode()


def _packed_hdf5(rng: np.random.Generator, path: Path) -> bytes:
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = 512.0
        for name, unit, row in zip(("force", "acc_1"), ("N", "m/s2"), _rows(rng), strict=True):
            kept = file.create_dataset(f"run/{name}", data=row, compression="gzip", chunks=(50,))
            kept.attrs["unit"] = unit
    return path.read_bytes()


def _mat_7_3(rng: np.random.Generator, path: Path) -> bytes:
    with h5py.File(path, "w", userblock_size=512) as file:
        values = (*_rows(rng), np.array([512.0]))
        for name, row in zip(("force", "acc_1", "fs"), values, strict=True):
            file.create_dataset(name, data=row[:, None]).attrs["MATLAB_class"] = np.bytes_("double")
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file, made by a test".ljust(116) + bytes(8) + b"\x00\x02IM"
    return bytes(content)


def _rows(rng: np.random.Generator) -> tuple[Any, Any]:
    force, first = rng.standard_normal((2, SAMPLES))
    return 800 * force, first


# ---------------------------------------------------------------- made to harm


def harmful_samples(folder: Path, bomb_bytes: int) -> list[Sample]:
    """Files that were made to break a reader or to lead it elsewhere; bombs unpack to so much."""
    folder.mkdir(exist_ok=True)
    zeros, row = bytes(bomb_bytes), b"1," * (bomb_bytes // 60)
    head = b"# sampling_rate_hz: 512\nforce,acc_1\n"
    deep = b'{"schema": "shm.modes/1", "tests": ' + b"[" * 200_000
    bomb = gzip.compress(head + b"1,2\n" * (bomb_bytes // 4), 1)
    return [
        Sample("gzip bomb", ".csv.gz", bomb),
        Sample("gzip bomb of uff", ".uff.gz", gzip.compress(b"    -1\n    58\n" + zeros, 1)),
        Sample("zip bomb", ".zip", _zip({"a.csv": zeros})),
        Sample("npz bomb", ".npz", _zip({"acc_1.npy": _npy_head(bomb_bytes // 8) + zeros})),
        Sample("bombs in an archive", ".zip", _zip({f"{n}.csv.gz": bomb for n in range(5)})),
        Sample("path out of an archive", ".zip", _zip({"../../x.csv": head})),
        Sample("mat bomb", ".mat", _mat_bomb(folder / "bomb.mat", zeros)),
        Sample("hdf5 bomb", ".h5", _hdf5(folder, lambda file: _chunk_bomb(file, bomb_bytes))),
        Sample("hdf5 of chunks", ".h5", _hdf5(folder, lambda file: _chunk_bomb(file, 2**45))),
        Sample("external link", ".h5", _hdf5(folder, _external_link)),
        Sample("external storage", ".h5", _hdf5(folder, _external_storage)),
        Sample("soft link", ".h5", _hdf5(folder, _soft_link)),
        Sample("virtual dataset", ".h5", _hdf5(folder, _virtual)),
        Sample("object reference", ".h5", _hdf5(folder, _reference)),
        Sample("pickled npz", ".npz", _pickled()),
        Sample("one endless row", ".csv", head + row),
        Sample("endless names", ".csv", row.replace(b"1,", b"a,") + b"\n1,2\n"),
        Sample("endless header", ".csv", b"# a: b\n" * 700_000 + head),
        Sample("deep document", ".modes.json", deep),
        Sample("long number", ".modes.json", deep[:35] + b"9" * 100_000 + b"}"),
        Sample("deep sidecar", ".csv", head + b"1,2\n" * 50, b"a = " + b"[" * 100_000),
        Sample("long sidecar", ".csv", head + b"1,2\n" * 50, b"# long\n" * 500_000),
    ]


def _zip(members: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def _npy_head(values: int) -> bytes:
    stream = io.BytesIO()
    said = {"descr": "<f8", "fortran_order": False, "shape": (values,)}
    np.lib.format.write_array_header_1_0(stream, said)
    return stream.getvalue()


def _mat_bomb(path: Path, zeros: bytes) -> bytes:
    savemat(path, {"acc_1": np.zeros(10)}, do_compression=False)
    head = path.read_bytes()[:128]
    element = struct.pack("<II", 14, len(zeros)) + path.read_bytes()[136:200]
    packed = zlib.compress(element + zeros, 1)
    return head + struct.pack("<II", 15, len(packed)) + packed


def _hdf5(folder: Path, fill: Callable[[h5py.File], None]) -> bytes:
    path = folder / "made.h5"
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = 512.0
        fill(file)
    return path.read_bytes()


def _chunk_bomb(file: h5py.File, values: int) -> None:
    chunk = (min(values, 2**20),)
    data = file.create_dataset("acc_1", (values,), "f8", chunks=chunk, compression="gzip")
    data[: chunk[0]] = 0.0


def _external_link(file: h5py.File) -> None:
    file["acc_1"] = h5py.ExternalLink("/etc/passwd", "/acc_1")


def _external_storage(file: h5py.File) -> None:
    file.create_dataset("acc_1", (100,), "u1", external=[("/etc/passwd", 0, 100)])


def _soft_link(file: h5py.File) -> None:
    file["acc_1"] = h5py.SoftLink("/acc_1")


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((100,), "u1")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", (100,))
    file.create_virtual_dataset("acc_1", layout)


def _reference(file: h5py.File) -> None:
    file.create_dataset("acc_1", data=[file.ref] * 50, dtype=h5py.ref_dtype)


def _pickled() -> bytes:
    stream = io.BytesIO()
    objects: Any = np.array([{"a": 1}] * 20, dtype=object)
    np.savez(stream, acc_1=objects)
    return stream.getvalue()


# ---------------------------------------------------------------- damage


def light(samples: list[Sample]) -> list[Sample]:
    """Those that are small enough to be damaged by the thousand."""
    return [sample for sample in samples if len(sample.content) < 50_000]


def damaged(samples: list[Sample], rng: np.random.Generator) -> Sample:
    """One of the samples with one to three kinds of damage; its name tells them."""
    sample = samples[rng.integers(len(samples))]
    for _ in range(rng.choice([1, 1, 1, 1, 2, 3])):
        kind = list(_DAMAGES)[rng.integers(len(_DAMAGES))]
        sample = replace(_DAMAGES[kind](sample, samples, rng), name=f"{sample.name}, {kind}")
    return sample


def _on_content(damage: Callable[[bytearray, np.random.Generator], bytes | bytearray]) -> Any:
    def apply(sample: Sample, samples: list[Sample], rng: np.random.Generator) -> Sample:
        if not sample.content:
            return sample
        return replace(sample, content=bytes(damage(bytearray(sample.content), rng)))

    return apply


def _place(content: bytearray, rng: np.random.Generator) -> int:
    """Any place, but every other time one in the head, where sizes stand."""
    end = len(content) if rng.random() < 0.5 else min(len(content), 1500)
    return int(rng.integers(end))


def _cut(content: bytearray, rng: np.random.Generator) -> bytearray:
    return content[: _place(content, rng)]


def _bits(content: bytearray, rng: np.random.Generator) -> bytearray:
    for _ in range(rng.integers(1, 20)):
        content[_place(content, rng)] ^= 1 << int(rng.integers(8))
    return content


def _bytes(content: bytearray, rng: np.random.Generator) -> bytearray:
    place = _place(content, rng)
    content[place : place + 8] = rng.bytes(int(rng.integers(1, 16)))
    return content


def _repeated(content: bytearray, rng: np.random.Generator) -> bytearray:
    begin, length = _place(content, rng), int(rng.integers(1, 2000))
    content[begin:begin] = content[begin : begin + length] * int(rng.integers(1, 5))
    return content


def _noise(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Random bytes behind the first few, by which a format is told."""
    kept = int(rng.choice([0, 8, 16, 128]))
    return content[:kept] + bytearray(rng.bytes(int(rng.integers(1, 3000))))


def _sizes(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Numbers of 4 or 8 bytes that may be lengths become hostile ones."""
    for _ in range(rng.integers(1, 4)):
        form = str(rng.choice(["<I", "<Q", ">I", ">Q"]))
        known = struct.pack(form, int(rng.choice(_LENGTHS)))
        places = [match.start() for match in re.finditer(re.escape(known), bytes(content))]
        place = int(rng.choice(places)) if places else _place(content, rng)
        hostile = _HOSTILE[rng.integers(len(_HOSTILE))] % 2 ** (8 * len(known))
        content[place : place + len(known)] = struct.pack(form, hostile)
    return content


def _digits(content: bytearray, rng: np.random.Generator) -> bytearray:
    runs = list(re.finditer(rb"\d+(\.\d+)?", bytes(content[:5000])))
    if runs:
        run = runs[rng.integers(len(runs))]
        content[run.start() : run.end()] = _HOSTILE_TEXT[rng.integers(len(_HOSTILE_TEXT))]
    return content


def _packed(sample: Sample, samples: list[Sample], rng: np.random.Generator) -> Sample:
    """Changes what is inside of a gzip, a .zip or .npz, or a packed .mat."""
    inner = replace(sample, content=_unpacked(sample))
    if inner.content == sample.content:
        return _DAMAGES["sizes"](sample, samples, rng)
    kind = str(rng.choice(["cut", "bits", "bytes", "sizes", "digits", "repeated"]))
    changed = _DAMAGES[kind](inner, samples, rng).content
    return replace(sample, content=_packed_again(sample, changed))


def _unpacked(sample: Sample) -> bytes:
    try:
        if sample.suffix.endswith(".gz"):
            return gzip.decompress(sample.content)[:100_000]
        if sample.suffix in (".zip", ".npz"):
            with zipfile.ZipFile(io.BytesIO(sample.content)) as archive:
                return archive.read(archive.namelist()[0])[:100_000]
        if sample.suffix == ".mat" and sample.content[128:132] == struct.pack("<I", 15):
            return zlib.decompressobj().decompress(sample.content[136:], 100_000)
    except (OSError, EOFError, ValueError, IndexError, zlib.error, zipfile.BadZipFile,
            NotImplementedError, RuntimeError, struct.error):  # fmt: skip
        return sample.content  # damaged before
    return sample.content


def _packed_again(sample: Sample, content: bytes) -> bytes:
    if sample.suffix.endswith(".gz"):
        return gzip.compress(content, 1)
    if sample.suffix == ".mat":
        packed = zlib.compress(content, 1)
        return sample.content[:128] + struct.pack("<II", 15, len(packed)) + packed
    return _zip({"acc_1.npy" if sample.suffix == ".npz" else "a.csv": content})


def _spliced(sample: Sample, samples: list[Sample], rng: np.random.Generator) -> Sample:
    """A piece of another file in the middle of this one."""
    other = samples[rng.integers(len(samples))].content
    begin = int(rng.integers(max(1, len(other))))
    content = bytearray(sample.content)
    place = int(rng.integers(len(content) + 1))
    content[place : place + int(rng.integers(500))] = other[begin : begin + 1000]
    return replace(sample, content=bytes(content))


def _sidecar(sample: Sample, samples: list[Sample], rng: np.random.Generator) -> Sample:
    beside = replace(sample, content=sample.sidecar or _SIDECAR)
    kind = str(rng.choice(["cut", "bits", "bytes", "digits", "repeated", "noise"]))
    return replace(sample, sidecar=_DAMAGES[kind](beside, samples, rng).content)


_DAMAGES: dict[str, Callable[[Sample, list[Sample], np.random.Generator], Sample]] = {
    "cut": _on_content(_cut),
    "bits": _on_content(_bits),
    "bytes": _on_content(_bytes),
    "repeated": _on_content(_repeated),
    "noise": _on_content(_noise),
    "sizes": _on_content(_sizes),
    "digits": _on_content(_digits),
    "packed": _packed,
    "spliced": _spliced,
    "sidecar": _sidecar,
}
