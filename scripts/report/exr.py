"""Reads the float channels of an EXR as skylit writes it: one part, scan lines, ZIP. Written from the format's specification, so that values that a report shows are
compared with what another reader finds in the file."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

ROWS_OF_A_BLOCK = 16
ZIP = 3
FLOAT = 2


@dataclass
class Exr:
    width: int
    height: int
    channels: dict[str, list[bytes]]  # a row of 32-bit values each

    def value(self, channel: str, x: int, y: int) -> float:
        return struct.unpack_from("<f", self.channels[channel][y], 4 * x)[0]

    def colours(self) -> list[str]:
        # a grey image has copies of Y as R, G and B
        return ["Y"] if "Y" in self.channels else ["R", "G", "B"]


def text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(0, at)
    return data[at:end].decode(), end + 1


def channel_types(value: bytes) -> list[tuple[str, int]]:
    found, at = [], 0
    while value[at] != 0:
        name, at = text(value, at)
        found.append((name, struct.unpack_from("<i", value, at)[0]))
        at += 16
    return found


def unzip(data: bytes, size: int) -> bytes:
    if len(data) == size:  # blocks that would grow are stored as they are
        return data
    deltas = bytearray(zlib.decompress(data))
    for k in range(1, len(deltas)):
        deltas[k] = (deltas[k - 1] + deltas[k] - 128) & 255
    half = (len(deltas) + 1) // 2
    whole = bytearray(len(deltas))
    whole[0::2], whole[1::2] = deltas[:half], deltas[half:]
    return bytes(whole)


def read(path: Path) -> Exr:
    data = path.read_bytes()
    magic, version = struct.unpack_from("<II", data)
    assert magic == 20000630 and version & 0x1E00 == 0, f"{path}: not an EXR of one part with scan lines"
    attributes, at = {}, 8
    while data[at] != 0:
        name, at = text(data, at)
        _, at = text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    at += 1
    assert attributes["compression"][0] == ZIP, f"{path}: its compression is not ZIP"
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    types = channel_types(attributes["channels"])
    rows: dict[str, list[bytes]] = {name: [b""] * height for name, kind in types if kind == FLOAT}
    blocks = -(-height // ROWS_OF_A_BLOCK)
    for offset in struct.unpack_from(f"<{blocks}Q", data, at):
        first, size = struct.unpack_from("<ii", data, offset)
        count = min(ROWS_OF_A_BLOCK, height - (first - top))
        block = unzip(data[offset + 8 : offset + 8 + size], count * len(types) * 4 * width)
        for row in range(count):
            for k, (name, kind) in enumerate(types):
                if kind == FLOAT:
                    start = (row * len(types) + k) * 4 * width
                    rows[name][first - top + row] = block[start : start + 4 * width]
    return Exr(width, height, rows)
