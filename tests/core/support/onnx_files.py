"""Tiny ONNX files, written byte by byte: no onnx package, no network of anybody's, and the exact answer is known."""

import struct

import numpy as np

FLOAT, INT64 = 1, 7


def _varint(n):
    out = bytearray()
    while True:
        out.append((n & 127) | (128 if n > 127 else 0))
        n >>= 7
        if not n:
            return bytes(out)


def _field(number, value):
    """A protobuf field: an int as varint, anything else length-delimited."""
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _tensor(name, array):
    kind = {"float32": FLOAT, "int64": INT64}[array.dtype.name]
    dims = b"".join(_field(1, int(n)) for n in array.shape)
    return dims + _field(2, kind) + _field(8, name) + _field(9, np.ascontiguousarray(array).tobytes())


def _value(name, kind, dims):
    shape = b"".join(_field(1, _field(2, d) if isinstance(d, str) else _field(1, d)) for d in dims)
    return _field(1, name) + _field(2, _field(1, _field(1, kind) + _field(2, shape)))


def node(op, inputs, outputs, **attributes):
    body = b"".join(_field(1, i) for i in inputs) + b"".join(_field(2, o) for o in outputs) + _field(4, op)
    for name, value in attributes.items():
        if isinstance(value, float):
            body += _field(5, _field(1, name) + _varint(2 << 3 | 5) + struct.pack("<f", value) + _field(20, 1))
        else:
            body += _field(5, _field(1, name) + _field(3, value) + _field(20, 2))
    return body


def write_onnx(path, nodes, constants, inputs, outputs):
    """`constants` name -> array; `inputs`, `outputs` name -> (element type, dims)."""
    graph = b"".join(_field(1, n) for n in nodes) + _field(2, "g")
    graph += b"".join(_field(5, _tensor(name, array)) for name, array in constants.items())
    graph += b"".join(_field(11, _value(name, *spec)) for name, spec in inputs.items())
    graph += b"".join(_field(12, _value(name, *spec)) for name, spec in outputs.items())
    path.write_bytes(_field(1, 8) + _field(7, graph) + _field(8, _field(1, "") + _field(2, 16)))
    return path


def image_net(path, channels, **answers):
    """A network of an `image` [1, C, H, W] that gives `answers` (name -> array), whatever the picture shows."""
    nodes, constants, outputs = [], {}, {}
    for name, array in answers.items():
        constants[f"{name}_value"] = array
        nodes.append(node("Identity", [f"{name}_value"], [name]))
        outputs[name] = (INT64 if array.dtype == np.int64 else FLOAT, array.shape)
    return write_onnx(path, nodes, constants, {"image": (FLOAT, (1, channels, "h", "w"))}, outputs)
