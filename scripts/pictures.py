#!/usr/bin/env python3
"""Makes the pictures of the README: one view of the stairs as real-time ambient occlusion, as a path tracer sees it, and how far apart the two are; and the viewer.
Makes those of docs/radius.md, too: one view over AO radius and falloff; and that of docs/realtime.md: what the passes of a frame leave.

    python3 scripts/pictures.py [SKYLIT]        # the program, target/release/skylit unless given; five minutes on two cores

The viewer runs a script, so the program is built with `cargo build --release --features probes`.

They go to docs/images. Python's own library is enough. The difference is that of the two PNGs' linear values: orange where ambient occlusion is darker than
the path-traced image, blue where it is brighter, white where they agree, and full colour at a difference of 0.25."""

from __future__ import annotations

import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VIEW = ["builtin:stairs", "--size", "360x270", "--eye=-2.2,2.4,6", "--target=-0.3,0.8,0", "--fov-y", "36"]
FULL = 0.25
# AO radii and falloffs of docs/radius.md, columns and rows
RADII = ["1%", "3%", "10%", "30%", "inf"]
FALLOFFS = ["1", "1.15", "1.5"]
ROOM = ["builtin:atrium", "--size", "240x160", "--spp", "256", "--pixel-filter", "centre"]
# a frame of docs/realtime.md in motion, after each of its passes; rows and columns
STAGES_VIEW = ["builtin:cornell-spheres", "--size", "240x180", "--orbit", "360", "--frames", "0..17"]
STAGES_ROWS = [["--preset", "balanced"], ["--preset", "balanced", "--integrator", "path"]]
ALONE = ["--antialias", "off", "--at-rest", "hold"]
STAGES = [
    ["--show", "depth"],
    ["--show", "normal"],
    [*ALONE, "--history", "1", "--filter", "none"],
    [*ALONE, "--filter", "none"],
    ALONE,
    [],
]
# pictures of the viewer, and the scripts that make them
VIEWER = {
    "viewer": (
        ["scenes/courtyard.gltf", "--size", "1160x640"],
        """wait picture
click Comparison
key X
wait 75
screenshot FILE
""",
    ),
    "viewer-path": (
        ["scenes/courtyard.gltf", "--size", "1160x640", "--integrator", "path", "--environment", "0.9,1.0,1.2", "--light",
         "sun direction=-0.5,-1,-0.35 irradiance=4", "--tone-map", "agx", "--exposure", "-0.7"],
        """wait picture
press 330 430
wait 160
screenshot FILE
""",
    ),
}


def read(path: Path) -> tuple[int, int, list[bytes]]:
    """Width, height, and rows of sRGB bytes of a PNG with 8-bit RGB or grey."""
    data, at, body, head = path.read_bytes(), 8, b"", (0, 0, 0)
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        chunk = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", chunk[:10])
            if depth != 8 or color not in (0, 2, 6):
                sys.exit(f"{path}: {depth} bits, color type {color}: expected 8-bit grey, RGB or RGBA")
            head = (width, height, {0: 1, 2: 3, 6: 4}[color])
        elif kind == b"IDAT":
            body += chunk
        at += 12 + length
    width, height, channels = head
    raw, stride, rows, last = zlib.decompress(body), width * channels, [], bytes(width * channels)
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1 : (y + 1) * (stride + 1)])
        for i in range(stride):
            a = line[i - channels] if i >= channels else 0
            b = last[i]
            c = last[i - channels] if i >= channels else 0
            if kind == 1:
                line[i] = line[i] + a & 255
            elif kind == 2:
                line[i] = line[i] + b & 255
            elif kind == 3:
                line[i] = line[i] + (a + b) // 2 & 255
            elif kind == 4:
                p = a + b - c
                distance = [(abs(p - v), k) for k, v in enumerate((a, b, c))]
                line[i] = line[i] + (a, b, c)[min(distance)[1]] & 255
        last = bytes(line)
        rows.append(bytes(line[i] for x in range(width) for i in ([x] * 3 if channels == 1 else range(x * channels, x * channels + 3))))
    return width, height, rows


def write(path: Path, width: int, height: int, rows: list[bytes]) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    body = zlib.compress(b"".join(b"\0" + row for row in rows), 9)
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


def linear(byte: int) -> float:
    v = byte / 255
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4


def srgb(value: float) -> int:
    v = value * 12.92 if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
    return max(0, min(255, round(v * 255)))


def sheet(file: Path, renders: list[list[list[str]]], skylit: Path) -> None:
    """Renders with these options, as rows and columns with white lines between. Of frames the last one."""
    line, rows = 4, []
    for of_row in renders:
        images = []
        for options in of_row:
            with tempfile.TemporaryDirectory() as temporary:
                image = Path(temporary) / ("##.png" if "--frames" in options else "image.png")
                subprocess.run([skylit, "render", "--no-config", *options, "-o", image, "--quiet"], check=True, cwd=ROOT)
                images.append(read(max(Path(temporary).iterdir())))
        between = bytes([255] * (3 * line))
        if rows:
            rows += [bytes([255] * len(rows[0]))] * line
        rows += [between.join(image[2][y] for image in images) for y in range(images[0][1])]
    write(file, len(rows[0]) // 3, len(rows), rows)


def radii(skylit: Path, folder: Path) -> None:
    """The room at each radius (columns) and falloff (rows)."""
    renders = [[[*ROOM, "--ao-radius", r, "--ao-falloff", f] for r in RADII] for f in FALLOFFS]
    sheet(folder / "radius.png", renders, skylit)


def stages(skylit: Path, folder: Path) -> None:
    """What the passes of a frame leave, of ambient occlusion and of light."""
    sheet(folder / "stages.png", [[[*STAGES_VIEW, *row, *stage] for stage in STAGES] for row in STAGES_ROWS], skylit)


def main() -> None:
    skylit = sys.argv[1] if len(sys.argv) > 1 else ROOT / "target/release/skylit"
    folder = ROOT / "docs/images"
    folder.mkdir(exist_ok=True)
    names = {"ao": ["--preset", "balanced"], "path": ["--integrator", "ao-sky", "--spp", "256"]}
    for name, options in names.items():
        subprocess.run([skylit, "render", "--no-config", *VIEW, *options, "-o", folder / f"{name}.png", "--quiet"], check=True, cwd=ROOT)
    width, height, a = read(folder / "ao.png")
    _, _, b = read(folder / "path.png")
    table = [linear(i) for i in range(256)]
    rows = []
    for row_a, row_b in zip(a, b, strict=True):
        row = bytearray()
        for x in range(width):
            d = table[row_a[3 * x]] - table[row_b[3 * x]]
            weight = min(1, abs(d) / FULL)
            full = (0.8, 0.2, 0.0) if d < 0 else (0.0, 0.25, 0.8)
            row += bytes(srgb(1 + (v - 1) * weight) for v in full)
        rows.append(bytes(row))
    write(folder / "difference.png", width, height, rows)
    radii(skylit, folder)
    stages(skylit, folder)
    for name, (options, script) in VIEWER.items():
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
            file.write(script.replace("FILE", str(folder / f"{name}.png")))
            file.flush()
            subprocess.run([skylit, "view", *options, "--headless-script", file.name, "--quiet"], check=True, cwd=ROOT)


if __name__ == "__main__":
    main()
