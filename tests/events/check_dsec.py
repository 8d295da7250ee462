"""Reads an events.h5 as DSEC's users do (h5py), and checks it against DSEC's own definitions.

    check_dsec.py EVENTS.h5 [RECTIFY_MAP.h5]

Prints `events width height t_offset`. Exit 77: no h5py here.
"""
import sys

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"check_dsec: skipped: {missing}")
    sys.exit(77)

TYPES = {"events/x": "uint16", "events/y": "uint16", "events/t": "uint32", "events/p": "uint8", "ms_to_idx": "uint64", "t_offset": "int64"}

with h5py.File(sys.argv[1], "r") as file:
    assert sorted(file) == ["events", "ms_to_idx", "t_offset"] and sorted(file["events"]) == ["p", "t", "x", "y"], list(file)
    for name, kind in TYPES.items():
        assert file[name].dtype == np.dtype(kind), (name, file[name].dtype)
    assert file["t_offset"].shape == ()
    x, y, t, p, index = (file[name][()] for name in ("events/x", "events/y", "events/t", "events/p", "ms_to_idx"))
    assert file["events/t"].compression == "gzip", file["events/t"].compression
    offset = int(file["t_offset"][()])
assert len(x) == len(y) == len(t) == len(p)
assert np.all(np.diff(t.astype(np.int64)) >= 0) and set(np.unique(p)) <= {0, 1}
# ms_to_idx by DSEC's definition: t[index[ms]] >= 1000 ms, t[index[ms] - 1] < 1000 ms.
assert np.array_equal(index, np.searchsorted(t, 1000 * np.arange(len(index)), side="left"))
assert len(t) == 0 or t[-1] <= 1000 * (len(index) - 1)
if len(sys.argv) > 2:
    with h5py.File(sys.argv[2], "r") as file:
        rectify = file["rectify_map"]
        assert rectify.dtype == np.float32 and rectify.shape[2] == 2, rectify
        assert len(x) == 0 or (x.max() < rectify.shape[1] and y.max() < rectify.shape[0])
        assert np.isfinite(rectify[()][y, x]).all()
print(len(t), int(x.max()) + 1 if len(x) else 0, int(y.max()) + 1 if len(y) else 0, offset)
