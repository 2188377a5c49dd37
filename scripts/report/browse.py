#!/usr/bin/env python3
"""Uses pages of reports in a browser and fails at the first thing that is wrong. scripts/report.sh calls it.

    browse.py --chromium PROGRAM --screenshots FOLDER [--images PAGE A.exr B.exr ...]... -- [PAGE...]

Of each PAGE it tests what all reports have in common; of those with --images also the comparison, whose values must be those of the files."""

from __future__ import annotations

import argparse
import struct
from pathlib import Path

from devtools import Browser
from exr import Exr, read

WIDE, PHONE = (1280, 900), (390, 844)


def check(holds: bool, what: str) -> None:
    if not holds:
        raise SystemExit(f"report: error: {what}")


def srgb(linear: float) -> int:
    v = min(1.0, max(0.0, linear))
    return round(255 * (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055))


def is_same_float(text: str, value: float) -> bool:
    return struct.pack("<f", float(text)) == struct.pack("<f", value)


def everything_in_common(browser: Browser, page: Path, screenshots: Path) -> None:
    """Both themes in both widths: nothing in the console, no control without a name, nothing wider than the screen."""
    name = page.parent.name
    for scheme in ("light", "dark"):
        browser.colour_scheme(scheme)
        for label, size, scale in (("wide", WIDE, 1), ("phone", PHONE, 2)):
            browser.resize(*size, scale=scale, is_phone=label == "phone")
            browser.open(page)
            browser.wait_for("[...skylitReport.comparisons.values()].every((c) => c.pixels || c.element.getBoundingClientRect().top > 2 * innerHeight)")
            browser.wait(0.3)
            width = browser.evaluate("document.documentElement.scrollWidth")
            check(width <= size[0], f"{page}: {width} pixels wide on a screen of {size[0]}")
            unnamed = browser.unnamed_controls()
            check(not unnamed, f"{page}: controls without a name: {unnamed}")
            dark = browser.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0] < 128")
            check(dark == (scheme == "dark"), f"{page}: the theme is not {scheme}")
            # all of the page, in a window as high as it is
            height = browser.evaluate("document.documentElement.scrollHeight")
            browser.resize(size[0], height, scale=scale, is_phone=label == "phone")
            browser.screenshot(screenshots / f"{name}-{label}-{scheme}.png")
    browser.evaluate("document.querySelector('[data-theme-toggle]').click()")
    check(browser.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0] > 128"), f"{page}: the theme cannot be chosen")
    browser.evaluate("for (let k = 0; k < 2; k += 1) document.querySelector('[data-theme-toggle]').click()")
    sorts = browser.evaluate("document.querySelectorAll('[data-sort]').length")
    if sorts:
        browser.evaluate("document.querySelector('table.data [data-sort]').click()")
        order = browser.evaluate("document.querySelector('table.data [data-sort]').closest('th').getAttribute('aria-sort')")
        check(order in ("ascending", "descending"), f"{page}: a table cannot be sorted")


class Comparison:
    """The first comparison of a page."""

    def __init__(self, browser: Browser, files: list[Exr]) -> None:
        self.browser, self.files = browser, files
        self.channels = max((f.colours() for f in files), key=len)

    def evaluate(self, expression: str):
        return self.browser.evaluate(f"(() => {{ const c = [...skylitReport.comparisons.values()][0]; return {expression}; }})()")

    def point(self, pixel: tuple[int, int], pane: int = 0) -> tuple[float, float]:
        """Where the middle of a pixel is in the window."""
        x, y = pixel
        found = self.evaluate(
            f"(() => {{ const canvas = c.panes[{pane}].canvas; canvas.scrollIntoView({{ block: 'center', behavior: 'instant' }}); const box = canvas.getBoundingClientRect();"
            f" const p = c.view.toPane([{x} + 0.5, {y} + 0.5]); return [box.left + canvas.clientLeft + p[0], box.top + canvas.clientTop + p[1]]; }})()"
        )
        return found[0], found[1]

    def colour(self, at: tuple[float, float], pane: int = 0) -> list[int]:
        """What the canvas shows at a point of the window, where it has not drawn the frame of the chosen pixel."""
        return self.evaluate(
            f"(() => {{ c.state.pixel = null; c.draw(); const canvas = c.panes[{pane}].canvas; const box = canvas.getBoundingClientRect();"
            f" const at = [{at[0]} - box.left - canvas.clientLeft, {at[1]} - box.top - canvas.clientTop].map((v) => Math.floor(v * devicePixelRatio));"
            " const copy = document.createElement('canvas').getContext('2d', { willReadFrequently: true }); copy.drawImage(canvas, -at[0], -at[1]);"
            " return [...copy.getImageData(0, 0, 1, 1).data]; })()"
        )

    def expected_colour(self, image: int, pixel: tuple[int, int], exposure: float = 0) -> list[int]:
        values = [self.value(image, c, pixel) for c in range(len(self.channels))]
        return [srgb(v * 2**exposure) for v in (values if len(values) == 3 else values * 3)]

    def value(self, image: int, channel: int, pixel: tuple[int, int]) -> float:
        return self.files[image].value(self.channels[channel], *pixel)

    def check_values(self, pixel: tuple[int, int], when: str) -> None:
        """The table has, of each image and channel, the file's number of this pixel."""
        self.browser.wait_for(f"[...skylitReport.comparisons.values()][0].element.querySelector('[data-pixel]').textContent.startsWith('Pixel {pixel[0]}, {pixel[1]}')", 5)
        shown = self.evaluate("[...c.element.querySelectorAll('[data-image]')].map((row) => [...row.querySelectorAll('[data-value-of]')].map((cell) => cell.textContent))")
        for k in range(len(self.files)):
            for channel in range(len(self.channels)):
                value = self.value(k, channel, pixel)
                check(is_same_float(shown[k][channel], value), f"{when}: {shown[k][channel]} is shown, and the file has {value} at {pixel}")

    def check_colour(self, image: int, pixel: tuple[int, int], pane: int, when: str, exposure: float = 0) -> None:
        shown, expected = self.colour(self.point(pixel, pane), pane), self.expected_colour(image, pixel, exposure)
        check(all(abs(a - b) <= 1 for a, b in zip(shown, expected)), f"{when}: colour {shown} instead of {expected} at {pixel}")


def use(browser: Browser, page: Path, files: list[Exr], screenshots: Path) -> None:
    browser.colour_scheme("light")
    browser.resize(*WIDE)
    browser.open(page)
    browser.wait_for("[...skylitReport.comparisons.values()][0].pixels !== null")
    c = Comparison(browser, files)
    width, height = files[0].width, files[0].height
    name = page.parent.name
    pixels = [(width // 3, height // 2), (width // 2, height // 4), (width - 2, height - 2), (0, 0)]

    for pixel in pixels:
        browser.mouse("mouseMoved", *c.point(pixel))
        c.check_values(pixel, "side by side")
    check(c.evaluate("c.panes.length") == len(files), "not all images are side by side")

    before = c.evaluate("c.view.scale()")
    for _ in range(4):
        browser.key("+")
    check(abs(c.evaluate("c.view.scale()") / before - 16) < 0.01, "four times + is not sixteenfold")
    middle = (width // 2, height // 2)
    for k in range(len(files)):
        browser.mouse("mouseMoved", *c.point(middle, k))
        c.check_values(middle, f"zoomed in, image {k}")
        c.check_colour(k, middle, k, f"zoomed in, image {k}")
    start = c.point(middle)
    browser.drag(start, (start[0] + 40, start[1] - 24))
    scale = c.evaluate("c.view.scale()")
    moved = c.evaluate("c.view.centre")
    check(abs(moved[0] - (width / 2 - 40 / scale)) < 0.1 and abs(moved[1] - (height / 2 + 24 / scale)) < 0.1, f"a drag moves the image to {moved}")
    browser.mouse("mouseWheel", *c.point(middle), deltaX=0, deltaY=-300)
    browser.wait(0.2)
    check(abs(c.evaluate("c.view.scale()") / scale - 2) < 0.05, "the wheel does not zoom an image that has the focus")
    browser.key("]")
    browser.key("]")
    c.check_colour(0, middle, 0, "a stop brighter", 1)
    browser.key("[")
    browser.key("[")
    browser.key("0")
    check(abs(c.evaluate("c.view.scale()") - before) < 1e-6, "0 does not fit the image in")

    browser.key("w")
    grip = browser.evaluate("(() => { const b = document.querySelector('.divider').getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]; })()")
    box = c.evaluate("(() => { const b = c.panes[0].canvas.getBoundingClientRect(); return [b.left, b.width]; })()")
    browser.drag((grip[0], grip[1]), (box[0] + 0.25 * box[1], grip[1]))
    at = browser.evaluate("Number(document.querySelector('.divider').getAttribute('aria-valuenow'))")
    check(abs(at - 25) <= 1, f"the slider was moved to 25 % and is at {at}")
    for _ in range(5):
        browser.key("+")
    # both sides of the line, at the pixel under it
    line = c.evaluate("c.view.toImage([0.25 * c.view.pane[0], c.view.pane[1] / 2]).map(Math.floor)")
    for image, step in ((0, -2), (1, 2)):
        c.check_colour(image, (line[0] + step, line[1]), 0, "slider")
    browser.key("0")
    browser.screenshot(screenshots / f"{name}-slider.png")
    browser.evaluate("document.querySelector('.divider').focus()")
    browser.key("ArrowRight")
    check(browser.evaluate("Number(document.querySelector('.divider').getAttribute('aria-valuenow'))") == at + 2, "the slider does not follow the keys")

    browser.key("f")
    captions = set()
    for _ in range(20):
        browser.wait(0.1)
        captions.add(c.evaluate("c.panes[0].caption.textContent"))
    check(len(captions) == 2, f"flicker shows {captions}")
    for k in range(len(files)):
        browser.key(str(k + 1))
        browser.wait(0.7)
        check(c.evaluate("c.state.shown") == k, f"key {k + 1} does not show image {k + 1} alone")

    browser.key("d")
    differences = []
    for y in range(0, height, 3):
        for x in range(0, width, 3):
            weights = (0.2126, 0.7152, 0.0722) if len(c.channels) == 3 else (1.0,)
            differences.append((sum(w * (c.value(0, k, (x, y)) - c.value(1, k, (x, y))) for k, w in enumerate(weights)), (x, y)))
    for (difference, pixel), sign in ((max(differences), 1), (min(differences), -1)):
        check(difference * sign > 0, "the images are not both brighter and darker somewhere")
        browser.evaluate(f"[...skylitReport.comparisons.values()][0].view.showRegion([{pixel[0]}, {pixel[1]}, 1, 1])")
        red, _, blue, _ = c.colour(c.point(pixel))
        check((red - blue) * sign > 20, f"a difference of {difference} at {pixel} is red {red}, blue {blue}")
    browser.key("0")
    browser.screenshot(screenshots / f"{name}-difference.png")
    browser.key("p")
    check(c.evaluate("c.state.view") == "flip" and not c.evaluate("c.element.querySelector('[data-legend]').hidden"), "FLIP has no legend")
    browser.wait(0.2)
    browser.screenshot(screenshots / f"{name}-flip.png")

    browser.key("s")
    browser.evaluate("document.querySelector('[data-region]').click()")
    browser.wait(0.3)
    check(c.evaluate("c.view.zoom !== null && c.state.region !== null"), "a region of the table is not shown")
    browser.screenshot(screenshots / f"{name}-region.png")
    browser.key("?")
    check(browser.evaluate("document.getElementById('help').open"), "? shows no help")
    browser.screenshot(screenshots / f"{name}-help.png")
    browser.key("Escape")
    check(not browser.evaluate("document.getElementById('help').open"), "Escape does not close the help")
    browser.key("0")
    browser.evaluate("[...skylitReport.comparisons.values()][0].panes[0].canvas.focus()")
    c.evaluate("c.set({ pixel: [3, 4] })")
    browser.key("ArrowRight", shift=True)
    c.check_values((4, 4), "by keys")
    said = c.evaluate("c.element.querySelector('[data-announce]').textContent")
    check(said.startswith("Pixel 4, 4."), f"a screen reader hears {said!r}")

    browser.resize(*PHONE, scale=2, is_phone=True)
    browser.open(page)
    browser.wait_for("[...skylitReport.comparisons.values()][0].pixels !== null")
    browser.wait(0.3)
    x, y = c.point(middle)
    browser.tap(x, y)
    # a finger is wider than a pixel, and a canvas smaller than its image
    shown = c.evaluate("c.state.pixel")
    check(shown is not None and abs(shown[0] - middle[0]) < 2 and abs(shown[1] - middle[1]) < 2, f"a tap shows pixel {shown} instead of {middle}")
    c.check_values((shown[0], shown[1]), "by a tap")
    before = c.evaluate("c.view.scale()")
    browser.pinch(x, y, 60, 180)
    check(2 < c.evaluate("c.view.scale()") / before < 4, "two fingers do not zoom")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chromium", required=True)
    parser.add_argument("--screenshots", type=Path, required=True)
    parser.add_argument("--images", nargs="+", action="append", default=[], metavar=("PAGE", "EXR"))
    parser.add_argument("pages", nargs="*", type=Path)
    args = parser.parse_args()
    browser = Browser(args.chromium)
    try:
        for page in [*(Path(given[0]) for given in args.images), *args.pages]:
            everything_in_common(browser, page, args.screenshots)
            print(f"report: {page}: both themes, both widths")
        for page, *files in args.images:
            use(browser, Path(page), [read(Path(f)) for f in files], args.screenshots)
            print(f"report: {page}: every view, every control")
        browser.wait(0.3)
        check(not browser.messages, "the browser has something to say:\n" + "\n".join(browser.messages))
    finally:
        browser.close()


if __name__ == "__main__":
    main()
