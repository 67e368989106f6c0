"""Write files that shm reads without a sidecar: HDF5, MATLAB, NumPy and TDMS.

Names, units and planes as `shm` understands them; what a file does not say stands in a sidecar.
`shm ingest --peek FILE` shows what it makes of any file.
"""

import tempfile
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from nptdms import ChannelObject, RootObject, TdmsWriter

import shm
from shm.read import peek, read

force, acceleration = np.random.default_rng(1).standard_normal((2, 5120))
named = {
    "force": force,
    "acc_1": acceleration,
    "sampling_rate_hz": 512.0,
    "hanger": 3,
    "force_unit": "N",
    "acc_1_unit": "g",
    "acc_1_plane": "transverse",
    "acc_1_x_m": 2.52,
}
in_tdms = {"wf_increment": 1 / 512}

with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    # Shown in the manual from here.
    with h5py.File(folder / "hanger3.h5", "w") as file:
        file.attrs.update(hanger=3, time="2026-05-01T10:00:00Z", sampling_rate_hz=512.0)
        file.create_dataset("force", data=force).attrs["unit"] = "N"
        file.create_dataset("acc_1", data=acceleration).attrs.update(
            unit="g", plane="transverse", x_m=2.52
        )
    # Shown in the manual until here.
    scipy.io.savemat(folder / "hanger3.mat", named)
    np.savez(folder / "hanger3.npz", **named)
    with TdmsWriter(folder / "hanger3.tdms") as writer:
        writer.write_segment(
            [
                RootObject({"hanger": 3}),
                ChannelObject("Log", "force", force, {"unit_string": "N", **in_tdms}),
                ChannelObject("Log", "acc_1", acceleration, {"unit_string": "g", **in_tdms}),
            ]
        )
    for path in sorted(folder.iterdir()):
        assert peek(path).problems == ()
        found = read(path)
        assert found.force is not None
        (channel,) = found.accelerations
        figure = shm.plot.recording(found)
        assert np.allclose(channel.values, 9.80665 * acceleration)
        print(
            f"{path.name}: hanger {found.hanger}, {channel.name} of {len(channel.values)} samples"
        )
