"""Conversions of the pixels of an answer. Functions that need numpy import it themselves."""
from __future__ import annotations

import struct
import zlib
from array import array
from typing import Any, List, Sequence, Tuple


def string_to_uint8_array(data: bytes) -> Any:
    """A numpy array of the bytes (of `image_data_uint8`)."""
    import numpy

    return numpy.frombuffer(data, dtype=numpy.uint8)


def string_to_float_array(data: bytes) -> Any:
    """A numpy array of the float32 that the bytes are."""
    import numpy

    return numpy.frombuffer(data, dtype=numpy.float32)


def list_to_2d_float_array(values: Sequence[float], width: int, height: int) -> Any:
    """A numpy array of `height` rows."""
    import numpy

    return numpy.reshape(numpy.asarray(values, dtype=numpy.float32), (height, width))


def get_pfm_array(response: Any) -> Any:
    """A numpy array of the picture of an answer that has floats."""
    return list_to_2d_float_array(response.image_data_float, response.width, response.height)


def write_file(filename: str, data: bytes) -> None:
    with open(filename, "wb") as file:
        file.write(data)


def write_pfm(filename: str, rows: Any, scale: float = 1.0) -> None:
    """`rows`: numpy array or lists, the top row first. The file's first row is the lowest, as PFM has it."""
    lines: List[Sequence[float]] = list(rows)
    with open(filename, "wb") as file:
        file.write(b"Pf\n%d %d\n%f\n" % (len(lines[0]), len(lines), -abs(scale)))
        for line in reversed(lines):
            file.write(struct.pack(f"<{len(line)}f", *line))


def read_pfm(filename: str) -> Tuple[List[array], float]:
    """(rows, the top one first; scale) of a PFM file of one channel."""
    with open(filename, "rb") as file:
        if file.readline().strip() != b"Pf":
            raise ValueError(f"{filename}: no PFM file of one channel")
        width, height = map(int, file.readline().split())
        scale = float(file.readline())
        order = "<" if scale < 0 else ">"
        rows = [array("f", struct.unpack(f"{order}{width}f", file.read(4 * width))) for _ in range(height)]
    return rows[::-1], abs(scale)


def write_png(filename: str, image: Any) -> None:
    """`image`: numpy array of height x width x 3 (blue, green, red) or 4 (and alpha), uint8."""
    height, width, channels = image.shape
    order = {3: (2, 1, 0), 4: (2, 1, 0, 3)}[channels]
    pixels = image[:, :, order].tobytes()
    rows = b"".join(b"\0" + pixels[y * width * channels:(y + 1) * width * channels] for y in range(height))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    write_file(filename, b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) +
               chunk(b"IEND", b""))
