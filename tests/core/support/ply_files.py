"""Splat .ply files made by hand for the tests: any layout, good and broken, without the code under test."""

import struct

import numpy as np

CODES = {"float": "f", "double": "d", "half": "e", "uchar": "B", "short": "h", "int": "i", "float32": "f", "float64": "d"}
GEOMETRY = ["x", "y", "z", "nx", "ny", "nz"]
REST = {0: 0, 1: 9, 2: 24, 3: 45}


def names(degree=0):
    """Property names in INRIA's order."""
    return [
        *GEOMETRY,
        *(f"f_dc_{i}" for i in range(3)),
        *(f"f_rest_{i}" for i in range(REST[degree])),
        "opacity",
        *(f"scale_{i}" for i in range(3)),
        *(f"rot_{i}" for i in range(4)),
    ]


def raw_table(count, degree=0, seed=0):
    """Raw (not activated) values per property, {name: (count,) float64} that float32 holds exactly."""
    rng = np.random.default_rng(seed)
    return {name: rng.normal(size=count).astype(np.float32).astype(np.float64) for name in names(degree)}


def ply_bytes(table, form="binary_little_endian", types=None, before=(), after=(), count=None, lines_end="\n"):
    """A PLY of `table`; `before` and `after` are (header lines, body bytes) of other elements."""
    types = types or {}
    rows = len(next(iter(table.values())))
    head = ["ply", f"format {form} 1.0", "comment made for a test"]
    for lines, _ in before:
        head += lines
    head += [f"element vertex {rows if count is None else count}"]
    head += [f"property {types.get(name, 'float')} {name}" for name in table]
    for lines, _ in after:
        head += lines
    head += ["end_header", ""]
    body = b"".join(data for _, data in before) + _body(table, rows, form, types) + b"".join(data for _, data in after)
    return lines_end.join(head).encode() + body


def _body(table, rows, form, types):
    columns = [(values.tolist(), types.get(name, "float")) for name, values in table.items()]
    if form == "ascii":
        return b"".join((" ".join(repr(c[i]) for c, _ in columns) + "\n").encode() for i in range(rows))
    order = "<" if form == "binary_little_endian" else ">"
    code = order + "".join(CODES[kind] for _, kind in columns)
    whole = {"B", "h", "i"}
    return b"".join(struct.pack(code, *(int(c[i]) if CODES[k] in whole else c[i] for c, k in columns)) for i in range(rows))
