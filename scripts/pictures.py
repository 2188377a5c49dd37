#!/usr/bin/env python3
"""Makes the pictures of README.md and of the pages of docs/: renders, compositions of renders, the viewer at work, and reports in a browser.

    python3 scripts/pictures.py [SKYLIT]                  # all of them; the program is target/release/skylit unless given
    python3 scripts/pictures.py [SKYLIT] --only NAME      # one, may be repeated; --list names them
    python3 scripts/pictures.py [SKYLIT] --scenes FOLDER  # models that are not part of the project, as FOLDER/dragon/dragon.glb and so on

They go to docs/images, and each command is printed before it runs. Python's own library is enough. The viewer runs scripts, so the program is built with
`cargo build --release --features probes`. Pages of HTML are photographed by Chromium, and the animation of the viewer is encoded by ffmpeg; a picture whose
program or model is missing is left out, and a line says so. All of them take some two hours on two cores without a GPU."""

from __future__ import annotations

import argparse
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path
from typing import Callable

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/report"))
from devtools import Browser  # noqa: E402 (its folder is no package)

FOLDER = ROOT / "docs/images"
LINE = 4
# width, height and rows of sRGB bytes
Image = tuple[int, int, list[bytes]]

# AO radii and falloffs of the guide's page about the radius, columns and rows
RADII = ["1%", "3%", "10%", "30%", "inf"]
FALLOFFS = ["1", "1.15", "1.5"]
ROOM = ["--size", "240x160", "--spp", "256", "--pixel-filter", "centre"]
# a frame in real time in motion, after each of its passes; rows and columns
STAGES_VIEW = ["--size", "240x180", "--orbit", "360", "--frames", "0..17"]
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
PATH = ["--integrator", "path", "--tone-map", "agx", "--denoise", "filter"]
SKY = ["--environment", "sky:55,240"]
LAMP = ["--light", "sphere position=30,70,-5 radius=4 radiance=400"]
HELMET_VIEW = ["--eye=0.28,0.52,0.72", "--target=0,0.45,0", "--fov-y", "36"]
METALS = [
    ["--material", "0 base_color=1,0.71,0.29 metallic=1 roughness=0.2", "--environment", "studio", "--tone-map", "neutral"],
    ["--material", "0 base_color=0.95,0.64,0.54 metallic=1 roughness=0.3", "--environment", "softbox", "--tone-map", "neutral"],
    ["--material", "0 base_color=0.91,0.92,0.92 metallic=1 roughness=0.1", "--environment", "sky", "--tone-map", "agx"],
]
STAIRS_LIT = ["--integrator", "path", "--environment", "0.06,0.07,0.09", "--size", "240x180", "--spp", "64", "--denoise", "--tone-map", "agx"]
# lights of the guide, from the left, above first
LIGHTS = [
    "sun direction=1,-0.9,-0.7 irradiance=3",
    "sun direction=1,-0.9,-0.7 irradiance=3 angle=20",
    "point position=0,2.5,2 intensity=10",
    "spot position=-1,4,3 direction=0.2,-1,-0.8 intensity=40 outer=20 inner=12",
    "rectangle position=-3,3,3 direction=1,-0.8,-0.9 size=1.5,1.5 radiance=12 temperature=3000",
    "led position=0,4,1 direction=0,-1,0 intensity=20 half_angle=35 temperature=6500",
]
SPHERE = ["--only", "1", "--integrator", "path", "--environment", "studio", "--eye", "0,1.5,4", "--target", "0,1.5,0", "--fov-y", "40", "--size", "180x180"]
ORBIT = ["--ao-radius", "10%", "--orbit", "480", "--frames", "0..24", "--size", "320x240", "--fov-y", "40"]
# models that are not part of the project: name of the file, and where it lies in the folder of --scenes
MODELS = {
    "sponza.glb": "sponza/sponza.glb",
    "dragon.glb": "dragon/dragon.glb",
    "FlightHelmet.gltf": "flight_helmet/FlightHelmet.gltf",
    "japanese-bridge-garden.glb": "web/japanese-bridge-garden.glb",
    "spruit_sunrise_1k.hdr": "env/spruit_sunrise_1k.hdr",
}


class Missing(Exception):
    """A program or a model that a picture needs and that is not there."""


class Studio:
    """The programs that make pictures, and where models are."""

    def __init__(self, skylit: Path, scenes: Path, temporary: Path) -> None:
        self.skylit, self.scenes, self.temporary, self.count = skylit, scenes, temporary, 0

    def path(self, suffix: str) -> Path:
        """A new file in the temporary folder."""
        self.count += 1
        return self.temporary / f"{self.count}{suffix}"

    def find(self, word: str) -> str:
        """The model of a name, or the word itself."""
        if word not in MODELS:
            return word
        file = self.scenes / MODELS[word]
        if not file.exists():
            raise Missing(f"{file} is not there (--scenes names the folder)")
        return str(file)

    def run(self, *words: str | Path, cwd: Path = ROOT, may_fail: bool = False) -> None:
        """Runs skylit with these words in a folder, after printing them as a command."""
        print("  skylit", shlex.join(str(word) for word in words), flush=True)
        found = [self.find(str(word)) if cwd == ROOT or not (cwd / str(word)).exists() else str(word) for word in words]
        done = subprocess.run([self.skylit, *found], cwd=cwd, stdout=subprocess.DEVNULL)
        if done.returncode and not may_fail:
            sys.exit(f"pictures: {shlex.join(found)} ends with {done.returncode}")

    def render(self, scene: str, *options: str) -> Image:
        """A render as a picture; of frames the last one."""
        folder = self.path("")
        folder.mkdir()
        self.run("render", scene, *options, "--no-config", "-o", folder / ("##.png" if "--frames" in options else "image.png"), "--quiet")
        return read(max(folder.iterdir()))

    def view(self, script: str, scene: str, *options: str) -> None:
        """Runs a script in the viewer, beside the model: its status line shows the path."""
        file, model = self.path(".txt"), Path(self.find(scene))
        file.write_text(script)
        cwd = model.parent if model.is_absolute() else ROOT
        shown = model.name if model.is_absolute() else scene
        self.run("view", shown, *options, "--no-config", "--headless-script", file, "--quiet", cwd=cwd)

    def photograph(self, page: Path, width: int, height: int, before: str = "") -> Image:
        """A page as a browser shows it, after its images are there and this JavaScript has run."""
        chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
        if not chromium:
            raise Missing("no Chromium")
        file, browser = self.path(".png"), Browser(chromium)
        browser.resize(width, height)
        browser.open(page)
        if before:
            browser.evaluate(before)
        near = "c.element.getBoundingClientRect().top > 2 * innerHeight"
        browser.wait_for(f"!window.skylitReport || [...skylitReport.comparisons.values()].every((c) => c.pixels || {near})")
        browser.wait(0.5)
        browser.screenshot(file)
        browser.close()
        return read(file)

    def save(self, name: str, image: Image, quality: int = 88) -> None:
        """Writes a picture into docs/images; skylit makes JPEG and WebP of PNG."""
        file = FOLDER / name
        if file.suffix == ".png":
            write(file, *image)
            return
        whole = self.path(".png")
        write(whole, *image)
        options = ["--jpeg-quality", str(quality)] if file.suffix == ".jpg" else []
        subprocess.run([self.skylit, "convert", whole, file, *options, "--quiet"], check=True)


def read(path: Path) -> Image:
    """Width, height, and rows of sRGB bytes of a PNG with 8-bit RGB, RGBA or grey."""
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
        for i in range(stride if kind else 0):
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
        rgb = bytearray(3 * width)
        for k in range(3):
            rgb[k::3] = last if channels == 1 else last[k::channels]
        rows.append(bytes(rgb))
    return width, height, rows


def write(path: Path, width: int, height: int, rows: list[bytes]) -> None:
    """A PNG, grey where all pixels are, with the one of three filters that makes it smallest."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    is_grey = all(row[0::3] == row[1::3] == row[2::3] for row in rows)
    if is_grey:
        rows = [row[::3] for row in rows]
    channels = 1 if is_grey else 3
    left = [bytes(a - b & 255 for a, b in zip(row, bytes(channels) + row)) for row in rows]
    above = [bytes(a - b & 255 for a, b in zip(row, up)) for row, up in zip(rows, [bytes(len(rows[0])), *rows])]
    filtered = [b"".join(bytes([kind]) + row for row in lines) for kind, lines in enumerate([rows, left, above])]
    body = min((zlib.compress(data, 9) for data in filtered), key=len)
    head = struct.pack(">IIBBBBB", width, height, 8, 0 if is_grey else 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


def linear(byte: int) -> float:
    v = byte / 255
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4


def srgb(value: float) -> int:
    v = value * 12.92 if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
    return max(0, min(255, round(v * 255)))


def beside(*images: Image) -> Image:
    """Images from left to right with white lines between, as high as the lowest."""
    height = min(image[1] for image in images)
    between = bytes([255] * (3 * LINE))
    rows = [between.join(image[2][y] for image in images) for y in range(height)]
    return len(rows[0]) // 3, height, rows


def below(*images: Image) -> Image:
    """Images from the top down with white lines between, as wide as the narrowest."""
    width = min(image[0] for image in images)
    rows: list[bytes] = []
    for image in images:
        rows += [bytes([255] * (3 * width))] * (LINE if rows else 0) + [row[: 3 * width] for row in image[2]]
    return width, len(rows), rows


def split(a: Image, b: Image) -> Image:
    """The left half of one image and the right half of another, with a white line between."""
    at, between = a[0] // 2, bytes([255] * 3 * LINE)
    left, right = 3 * (at - LINE // 2), 3 * (at - LINE // 2 + LINE)
    return a[0], a[1], [row_a[:left] + between + row_b[right:] for row_a, row_b in zip(a[2], b[2], strict=True)]


def cut(image: Image, x: int, y: int, width: int, height: int) -> Image:
    """A rectangle of an image."""
    return width, height, [row[3 * x : 3 * (x + width)] for row in image[2][y : y + height]]


def difference(a: Image, b: Image, full_at: float) -> Image:
    """Linear values of two grey images: orange where the first is darker, blue where it is brighter, with full colour at a difference."""
    table = [linear(i) for i in range(256)]
    rows = []
    for row_a, row_b in zip(a[2], b[2], strict=True):
        row = bytearray()
        for x in range(a[0]):
            d = table[row_a[3 * x]] - table[row_b[3 * x]]
            weight = min(1, abs(d) / full_at)
            full = (0.8, 0.2, 0.0) if d < 0 else (0.0, 0.25, 0.8)
            row += bytes(srgb(1 + (v - 1) * weight) for v in full)
        rows.append(bytes(row))
    return a[0], a[1], rows


def sheet(images: list[list[Image]]) -> Image:
    """Rows and columns of images."""
    return below(*(beside(*row) for row in images))


# ---- README ----


def readme(studio: Studio) -> None:
    """The atrium and FlightHelmet as ambient occlusion and path traced: each pair, and both in one wide picture."""
    size, ao, pairs = ["--size", "598x400"], ["--spp", "32", "--denoise", "filter"], []
    a = studio.render("builtin:atrium", *size, *ao, "--ao-falloff", "1.02")
    pairs.append((a, studio.render("builtin:atrium", *size, *PATH, *SKY, "--spp", "48", "--exposure", "0.5")))
    a = studio.render("FlightHelmet.gltf", *size, *HELMET_VIEW, *ao, "--hide", "Lenses_low", "--background", "0.12,0.12,0.12")
    pairs.append((a, studio.render("FlightHelmet.gltf", *size, *HELMET_VIEW, *PATH, "--environment", "spruit_sunrise_1k.hdr", "--spp", "96")))
    for name, pair in zip(("atrium", "helmet"), pairs):
        studio.save(f"readme-{name}.jpg", beside(*pair))
    studio.save("readme-wide.jpg", beside(*(split(*pair) for pair in pairs)))


def viewer_at_work(studio: Studio) -> None:
    """Orbits in the atrium, drags the AO radius, and puts the truth beside it: fifteen seconds at eight frames a second."""
    ffmpeg = shutil.which("ffmpeg")
    if not ffmpeg:
        raise Missing("no ffmpeg")
    folder, lines, shots = studio.path(""), ["wait picture", "wait 15"], []
    folder.mkdir()

    def shoot(frames: int = 1) -> None:
        """One picture, which is shown for this many frames."""
        shots.append((folder / f"shot{len(shots)}.png", frames))
        lines.append(f"screenshot {shots[-1][0]}")

    # orbit: to the right, to the left, and back; shorter drags would be clicks
    shoot(10)
    for step in [8] * 9 + [-8] * 12 + [8] * 3:
        lines.extend([f"drag 280 300 {280 + step} 300 0.1", "wait 1.2"])
        shoot()
    # the radius: from a third of the scene to what is near, and back to where the arcades are dark
    lines.extend(["wait 3", "click Radius", "set Radius = 30", "wait 8"])
    shoot(6)
    for k in range(28):
        exponent = k / 18 if k < 18 else (36 - k) / 18
        lines.extend([f"set Radius = {30 * 0.03**exponent:.2f}", "wait 1.5"])
        shoot()
    # the truth beside it, and the line between them
    lines.extend(["wait 10", "key X", "wait 30"])
    shoot(12)
    x = 280
    for step in [12] * 8 + [-12] * 16:
        lines.extend([f"drag {x} 300 {x + step} 300 0.1", "wait 0.6"])
        x += step
        shoot()
    lines.append("wait 30")
    shoot(16)
    studio.view("\n".join(lines) + "\n", "builtin:atrium", "--size", "860x500", "--frame-rate", "0")
    number = 0
    for shot, frames in shots:
        for _ in range(frames):
            shutil.copy(shot, folder / f"{number:03}.png")
            number += 1
    options = ["-c:v", "libwebp_anim", "-lossless", "0", "-q:v", "60", "-compression_level", "6", "-loop", "0"]
    command = [ffmpeg, "-loglevel", "error", "-y", "-framerate", "8", "-i", folder / "%03d.png", *options, FOLDER / "viewer-at-work.webp"]
    subprocess.run(command, check=True)


# ---- pages of docs/ ----


def radii(studio: Studio) -> None:
    """The atrium at each radius (columns) and falloff (rows)."""
    images = [[studio.render("builtin:atrium", *ROOM, "--ao-radius", r, "--ao-falloff", f) for r in RADII] for f in FALLOFFS]
    studio.save("radius.png", sheet(images))


def stages(studio: Studio) -> None:
    """What the passes of a frame leave, of ambient occlusion and of light."""
    images = [[studio.render("builtin:cornell-spheres", *STAGES_VIEW, *row, *stage) for stage in STAGES] for row in STAGES_ROWS]
    studio.save("stages.png", sheet(images))


def materials(studio: Studio) -> None:
    """A ball for each extension of glTF's materials."""
    subprocess.run([sys.executable, ROOT / "scripts/material_balls.py", studio.skylit], check=True)


def viewer(studio: Studio) -> None:
    """The viewer, with ambient occlusion and its truth side by side."""
    script = f"wait picture\nclick Comparison\nkey X\nwait 75\nscreenshot {FOLDER / 'viewer.png'}\n"
    studio.view(script, "scenes/courtyard.gltf", "--size", "1160x640")


def viewer_path(studio: Studio) -> None:
    """The viewer, path tracing, with the material of the floor."""
    light = ["--environment", "0.9,1.0,1.2", "--light", "sun direction=-0.5,-1,-0.35 irradiance=4", "--tone-map", "agx", "--exposure", "-0.7"]
    script = f"wait picture\npress 330 430\nwait 160\nscreenshot {FOLDER / 'viewer-path.png'}\n"
    studio.view(script, "scenes/courtyard.gltf", "--size", "1160x640", "--integrator", "path", *light)


def denoising(studio: Studio) -> None:
    """Ambient occlusion and paths of few samples: noisy, denoised, and what many samples converge to."""
    size = ["--size", "316x220"]
    rows = []
    for integrator, few, many in (([], "16", "256"), (["--integrator", "path", "--tone-map", "agx", *SKY], "8", "128")):
        view = ["builtin:atrium", *size, *integrator]
        noisy = studio.render(*view, "--spp", few)
        rows.append([noisy, studio.render(*view, "--spp", few, "--denoise", "filter"), studio.render(*view, "--spp", many)])
    studio.save("denoising.jpg", sheet(rows), 92)


def layers(studio: Studio) -> None:
    """The layers of an image with all auxiliary outputs."""
    file, images = studio.path(".exr"), []
    studio.run("render", "builtin:atrium", "--size", "316x200", "--spp", "32", "--denoise", "filter", "--aov", "all", "--no-config", "-o", file, "--quiet")
    # the background has depth infinity and the largest id: ranges are those of what is seen
    shown = [[], ["--layer", "depth", "--range", "5,70"], ["--layer", "Ns"], ["--layer", "position", "--range=-32,32"]]
    for options in [*shown, ["--layer", "albedo"], ["--layer", "id.instance", "--range", "0,800"]]:
        image = studio.path(".png")
        studio.run("convert", file, image, *options)
        images.append(read(image))
    studio.save("layers.jpg", sheet([images[:3], images[3:]]), 92)


def ao_vs_path(studio: Studio) -> None:
    """The error of ambient occlusion over its radius, as `compare ao-vs-path` plots it."""
    plot = studio.path(".svg")
    studio.run("compare", "ao-vs-path", "builtin:atrium", "--size", "320x180", "--plot", plot, "--quiet")
    studio.save("ao-vs-path.png", studio.photograph(plot, 1440, 550))


def baking(studio: Studio) -> None:
    """A model with its baked occlusion texture, and the ambient occlusion that is traced."""
    view = ["--size", "316x300", "--eye=-2.2,2.4,6", "--target=-0.3,0.8,0", "--fov-y", "36"]
    images = []
    for size in ("64", "512"):
        model, image, picture = studio.path(".glb"), studio.path(".exr"), studio.path(".png")
        studio.run("bake", "builtin:stairs", "-o", model, "--size", size, "--denoise")
        studio.run("render", model, *view, "--integrator", "baked-occlusion", "--no-config", "-o", image, "--quiet")
        # a picture of this integrator has no transfer function; that of the image has sRGB's
        studio.run("convert", image, picture)
        images.append(read(picture))
    images.append(studio.render("builtin:stairs", *view, "--spp", "128", "--denoise", "filter"))
    studio.save("baking.png", beside(*images))


def resuming(studio: Studio) -> None:
    """An image whose noise is bounded, and the samples that each of its tiles took."""
    file, image, samples = studio.path(".exr"), studio.path(".png"), studio.path(".png")
    options = ["--size", "396x396", "--integrator", "path", "--quality", "draft", "--tone-map", "agx", "--environment", "spruit_sunrise_1k.hdr"]
    studio.run("render", "FlightHelmet.gltf", *options, "--no-config", "-o", file, "-o", image, "--quiet")
    studio.run("convert", file, samples, "--layer", "samples", "--range", "0,128")
    studio.save("resuming.jpg", beside(read(image), read(samples)), 92)


# ---- the guide ----


def guide_install(studio: Studio) -> None:
    """The image that shows that the program works."""
    studio.save("guide-install.png", studio.render("builtin:stairs", "--size", "480x270", "--denoise"))


def guide_first(studio: Studio) -> None:
    """The first image: noisy, with a radius and denoised, and path traced."""
    view = ["builtin:atrium", "--size", "480x270"]
    studio.save("guide-first-noisy.png", studio.render(*view))
    studio.save("guide-first-ao.png", studio.render(*view, "--ao-radius", "10%", "--spp", "64", "--denoise"))
    path = ["--integrator", "path", "--environment", "sky:60,240", "--spp", "128", "--denoise", "--tone-map", "agx", "--exposure", "0.7"]
    studio.save("guide-first-path.jpg", studio.render(*view, *path), 92)


def guide_environments(studio: Studio) -> None:
    """FlightHelmet in six environments."""
    view = ["FlightHelmet.gltf", "--integrator", "path", "--size", "320x320", "--spp", "48", "--denoise", "--tone-map", "agx"]
    images = [studio.render(*view, "--environment", e) for e in ("studio", "softbox", "overcast", "sky:60,120")]
    images.append(studio.render(*view, "--environment", "sky:4,250,3", "--exposure", "3"))
    images.append(studio.render(*view, "--environment", "1,1,1"))
    studio.save("guide-environments.jpg", sheet([images[:3], images[3:]]), 92)


def guide_lights(studio: Studio) -> None:
    """The stairs under six kinds of light."""
    images = [studio.render("builtin:stairs", *STAIRS_LIT, "--light", light) for light in LIGHTS]
    studio.save("guide-lights.jpg", sheet([images[:3], images[3:]]), 92)


def guide_roughness(studio: Studio) -> None:
    """A sphere of five values of roughness, as a dielectric and as a metal."""
    view = ["builtin:sphere-over-plane", *SPHERE, "--spp", "64", "--denoise", "--tone-map", "neutral"]
    values = [[f"0 base_color=0.9,0.35,0.08 metallic={m} roughness={r}" for r in (0, 0.25, 0.5, 0.75, 1)] for m in (0, 1)]
    studio.save("guide-roughness.png", sheet([[studio.render(*view, "--material", value) for value in row] for row in values]))


def guide_presets(studio: Studio) -> None:
    """Part of a frame in motion: the rays of one frame alone, and three presets."""
    alone = ["--preset", "fast", "--history", "1", "--filter", "none", "--antialias", "off"]
    rows = [alone, *(["--preset", preset] for preset in ("fast", "balanced", "quality"))]
    images = [studio.render("builtin:atrium", *ORBIT, *options) for options in rows]
    studio.save("guide-presets.png", beside(*(enlarged(cut(image, 0, 90, 150, 112), 2) for image in images)))


def guide_parade(studio: Studio) -> None:
    """Four moments of an animation, path traced in real time."""
    view = ["--integrator", "path", "--preset", "balanced", "--environment", "sky:40,120", "--size", "320x180", "--tone-map", "agx"]
    images = [studio.render("builtin:parade", "--animate", "--fps", "24", "--frames", f"0..{n + 1}", *view) for n in (0, 12, 24, 36)]
    studio.save("guide-parade.jpg", beside(*images), 92)


def guide_turn(studio: Studio) -> None:
    """FlightHelmet, which turns once around: an animated PNG."""
    file = studio.path(".apng")
    options = ["--preset", "quality", "--rays-per-pixel", "16", "--orbit", "32", "--frames", "0..32", "--lead-in", "8", "--fps", "8"]
    studio.run("render", "FlightHelmet.gltf", *options, "--size", "160x160", "--no-config", "-o", file, "--quiet")
    shutil.copy(file, FOLDER / "guide-turn.png")


def guide_viewer_list(studio: Studio) -> None:
    """The viewer in its dark theme, with the list of what can be seen."""
    script = ["wait picture", "wait 75", "click Show", "wait 3"]
    script.append(f"screenshot {(file := studio.path('.png'))}")
    studio.view("\n".join(script) + "\n", "builtin:atrium", "--size", "1160x640", "--preset", "balanced", "--ao-radius", "10%")
    studio.save("guide-viewer-list.png", read(file))


def guide_viewer_light(studio: Studio) -> None:
    """The viewer in its light theme, path tracing, with the section Light."""
    # a section is called View, too, so the menu is pressed by its place
    script = ["wait picture", "press 56 13", "wait 1", "click Theme", "click Light", "key Escape", "wait 1", "click Light", "wait 150"]
    script.append(f"screenshot {(file := studio.path('.png'))}")
    options = ["--integrator", "path", "--preset", "balanced", "--environment", "studio"]
    studio.view("\n".join(script) + "\n", "builtin:parade", "--size", "1160x640", *options)
    studio.save("guide-viewer-light.png", read(file))


# ---- the gallery ----


def gallery_ao(studio: Studio) -> None:
    """Ambient occlusion without a radius, and with one."""
    view = ["--size", "478x320", "--spp", "64", "--denoise", "filter"]
    images = [studio.render("builtin:atrium", *view), studio.render("builtin:atrium", *view, "--ao-radius", "4%")]
    studio.save("gallery-ao.jpg", beside(*images))


def gallery_bent(studio: Studio) -> None:
    """Geometric normals and bent normals."""
    view = ["--preset", "balanced", "--size", "478x360"]
    images = [studio.render("dragon.glb", *view, "--show", show) for show in ("normal", "bent")]
    studio.save("gallery-bent.jpg", beside(*images))


def gallery_truth(studio: Studio) -> None:
    """Ambient occlusion, its truth, and where they differ."""
    size = ["--size", "316x240"]
    a = studio.render("builtin:atrium", *size, "--spp", "128", "--denoise", "filter")
    b = studio.render("builtin:atrium", *size, "--integrator", "ao-sky", "--spp", "64", "--denoise", "filter")
    studio.save("gallery-truth.jpg", beside(a, b, difference(a, b, 0.12)))


def gallery_interior(studio: Studio) -> None:
    """Sponza's nave with a lamp."""
    view = ["--eye=-120,20,-5", "--target=50,35,0", "--fov-y", "70"]
    studio.save("gallery-interior.jpg", studio.render("sponza.glb", "--size", "960x540", *view, *LAMP, *PATH, "--spp", "16", "--exposure", "0.5"), 86)


def gallery_exterior(studio: Studio) -> None:
    """A garden under the sky."""
    view = ["--eye=3.0,2.4,11.5", "--target=-0.4,3.5,0", "--fov-y", "40"]
    light = ["--environment", "sky:30,120"]
    studio.save("gallery-exterior.jpg", studio.render("japanese-bridge-garden.glb", "--size", "960x540", *view, *PATH, *light, "--spp", "32"))


def gallery_glass(studio: Studio) -> None:
    """Glass, a mirror and what they focus."""
    view = ["--integrator", "path", "--size", "478x478", "--spp", "128", "--firefly-clamp", "2", "--tone-map", "agx", "--exposure", "1.5"]
    view += ["--denoise", "filter"]
    images = [studio.render(scene, *view) for scene in ("builtin:cornell-glass-sphere", "builtin:cornell-spheres")]
    studio.save("gallery-glass.jpg", beside(*images))


def gallery_metals(studio: Studio) -> None:
    """The dragon in gold, copper and silver, by an option alone."""
    images = [studio.render("dragon.glb", "--integrator", "path", "--size", "316x300", "--spp", "64", "--denoise", "filter", *metal) for metal in METALS]
    studio.save("gallery-metals.jpg", beside(*images))


def gallery_viewer(studio: Studio) -> None:
    """The viewer in its dark and its light theme."""
    dark, light = studio.path(".png"), studio.path(".png")
    script = ["wait picture", "wait 40", f"screenshot {dark}"]
    # the menu "View", which has the name of a section of the panel
    script += ["press 55 12", "wait 1", "click Theme", "wait 1", "click Light", "wait 1", "key Escape", "wait 2", f"screenshot {light}"]
    studio.view("\n".join(script) + "\n", "FlightHelmet.gltf", "--size", "720x480", "--integrator", "path", "--preset", "balanced",
                "--environment", "spruit_sunrise_1k.hdr", *HELMET_VIEW)
    studio.save("gallery-viewer.jpg", beside(read(dark), read(light)), 90)


def gallery_compare(studio: Studio) -> None:
    """The report of a comparison."""
    renders = ["--a", "ao --spp 64 --denoise filter", "--b", "ao-sky --spp 64 --denoise filter --seed 1"]
    studio.run("compare", "--scene", "builtin:atrium", "--size", "480x270", *renders, "--html", "report", cwd=studio.temporary)
    before = "document.querySelector('[data-view=slider]').click(); document.querySelector('[data-view]').scrollIntoView()"
    studio.save("gallery-compare.png", studio.photograph(studio.temporary / "report/index.html", 960, 760, before))


MANIFEST = """[drivers]
pinned = ["llvmpipe"]

[[frame]]
name = "stairs-ao"
scene = "stairs.glb"
render = "ao --size 192x144 --spp 64 --eye=-2.2,2.4,6 --target=-0.3,0.8,0 --fov-y 36"
tolerance = { flip = { percentile = 99, max = 0.05 } }

[[frame]]
name = "box-path"
scene = "builtin:cornell-box"
render = "path --size 128x128 --spp 64"
tolerance = "z_test"
"""


def gallery_verify(studio: Studio) -> None:
    """The report of reference frames, one of which differs because an object of its scene is gone."""
    here, frames = studio.temporary, studio.temporary / "frames"
    frames.mkdir()
    (frames / "frames.toml").write_text(MANIFEST)
    studio.run("export", "builtin:stairs", "frames/stairs.glb", cwd=here)
    studio.run("verify", "frames", "--update-missing", "--force", cwd=here)
    studio.run("export", "builtin:stairs", "frames/stairs.glb", "--hide", "rail", cwd=here)
    studio.run("verify", "frames", "--html", "report", cwd=here, may_fail=True)
    studio.save("gallery-verify.png", studio.photograph(here / "report/index.html", 960, 1000))


def gallery_bench(studio: Studio) -> None:
    """The report of a benchmark."""
    scenes = ["cornell", "sphere-mirror"]
    studio.run("bench", "path", "--quick", *scenes, "--strategies", "mis,bsdf,light", "--html", "report", cwd=studio.temporary)
    page = studio.photograph(studio.temporary / "report/index.html", 960, 1000)
    # the head of the page names the machine
    studio.save("gallery-bench.png", cut(page, 0, 268, 960, 610))


PICTURES: dict[str, Callable[[Studio], None]] = {
    "readme": readme,
    "viewer-at-work": viewer_at_work,
    "radius": radii,
    "stages": stages,
    "materials": materials,
    "viewer": viewer,
    "viewer-path": viewer_path,
    "denoising": denoising,
    "layers": layers,
    "ao-vs-path": ao_vs_path,
    "baking": baking,
    "resuming": resuming,
    "guide-install": guide_install,
    "guide-first": guide_first,
    "guide-environments": guide_environments,
    "guide-lights": guide_lights,
    "guide-roughness": guide_roughness,
    "guide-presets": guide_presets,
    "guide-parade": guide_parade,
    "guide-turn": guide_turn,
    "guide-viewer-list": guide_viewer_list,
    "guide-viewer-light": guide_viewer_light,
    "gallery-ao": gallery_ao,
    "gallery-bent": gallery_bent,
    "gallery-truth": gallery_truth,
    "gallery-interior": gallery_interior,
    "gallery-exterior": gallery_exterior,
    "gallery-glass": gallery_glass,
    "gallery-metals": gallery_metals,
    "gallery-viewer": gallery_viewer,
    "gallery-compare": gallery_compare,
    "gallery-verify": gallery_verify,
    "gallery-bench": gallery_bench,
}


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the pictures of README.md and of docs/.")
    parser.add_argument("skylit", nargs="?", type=Path, default=ROOT / "target/release/skylit", help="the program, built with the feature `probes`")
    parser.add_argument("--only", action="append", choices=sorted(PICTURES), metavar="NAME", help="make this picture alone; may be repeated")
    parser.add_argument("--scenes", type=Path, default=ROOT.parent / "shared/scenes", help="folder with models that are not part of the project")
    parser.add_argument("--list", action="store_true", help="print names and subjects of all pictures")
    args = parser.parse_args()
    if args.list:
        for name, make in PICTURES.items():
            print(f"{name:20}{(make.__doc__ or '').splitlines()[0]}")
        return
    if not args.skylit.exists():
        sys.exit(f"pictures: {args.skylit} is not there: `cargo build --release --features probes` makes it, or name another program")
    FOLDER.mkdir(exist_ok=True)
    for name in args.only or PICTURES:
        print(name, flush=True)
        with tempfile.TemporaryDirectory() as temporary:
            try:
                PICTURES[name](Studio(args.skylit.resolve(), args.scenes.resolve(), Path(temporary)))
            except Missing as missing:
                print(f"pictures: {name} is left out: {missing}", file=sys.stderr)


if __name__ == "__main__":
    main()
