// A comparison of images: what is shown of them, in which panes.
(() => {
  "use strict";
  const report = window.skylitReport;
  const NARROWEST = 300;

  report.Comparison = class {
    constructor(element) {
      this.element = element;
      this.about = JSON.parse(element.querySelector("script[type='application/json']").textContent);
      const { images, reference, size } = this.about;
      this.panesElement = element.querySelector("[data-panes]");
      this.view = new report.View(size);
      this.state = {
        view: "side", image: images.findIndex((_, k) => k !== reference), other: reference, shown: 0,
        alternate: !matchMedia("(prefers-reduced-motion: reduce)").matches,
        exposure: 0, channel: this.about.channels.length === 3 ? -1 : 0, scale: 0.1, split: 0.5, pixel: null, region: null,
      };
      if (this.state.image < 0) this.state.image = reference;
      this.state.shown = this.state.image;
      this.bitmaps = new Map();
      this.panes = [];
      this.pixels = null;
      this.changed = () => {};
    }

    async load() {
      const { key, source, channels } = this.about;
      try {
        this.pixels = await report.loadPixels(key, source, channels.length);
      } catch (error) {
        this.panesElement.querySelector(".loading").textContent = `The images cannot be shown: ${error.message}`;
        return;
      }
      this.chooseScale();
      this.observer = new ResizeObserver(() => this.layout());
      this.rebuild();
      this.observer.observe(this.panesElement);
    }

    name(k) {
      const { images, reference } = this.about;
      return `${images[k].name}${k === reference ? " (reference)" : ""}`;
    }

    chooseScale() {
      const { image, other, channel } = this.state;
      const [a, b] = [image, other].map((k) => this.pixels.images[k].planes);
      this.state.scale = report.typicalDifference(a, b, channel, this.pixels.mask);
    }

    // Bitmaps are kept as long as their settings: one of each kind and image.
    bitmap(kind, image) {
      const { exposure, other, channel, scale } = this.state;
      const { size } = this.about;
      const { images, mask } = this.pixels;
      const settings = { image: exposure, difference: [other, channel, scale].join(), flip: "" }[kind];
      const kept = this.bitmaps.get(`${kind} ${image}`);
      if (kept && kept.settings === settings) return kept.bitmap;
      const make = {
        image: () => report.imageBitmap(size, images[image].planes, exposure),
        difference: () => report.differenceBitmap(size, images[image].planes, images[other].planes, channel, scale, mask),
        flip: () => report.flipBitmap(size, images[image].flip, mask),
      };
      const bitmap = make[kind]();
      this.bitmaps.set(`${kind} ${image}`, { settings, bitmap });
      return bitmap;
    }

    // Changes settings and shows the result. A change of the view needs other panes.
    set(changes) {
      const before = this.state;
      this.state = { ...before, ...changes };
      if (this.state.view === "flip" && !this.about.images[this.state.image].has_flip) {
        this.state.image = this.about.images.findIndex((i) => i.has_flip);
      }
      if (!this.pixels) return;
      const rescaled = ["image", "other", "channel"].some((k) => before[k] !== this.state[k]);
      if (rescaled && changes.scale === undefined) this.chooseScale();
      if (before.view !== this.state.view) this.rebuild();
      else this.show();
    }

    rebuild() {
      const { Pane } = report;
      const shows = (kind, image) => [{ bitmap: this.bitmap(kind, image) }];
      const single = (layers) => [new Pane(this.view, layers)];
      const s = () => this.state;
      this.panes = {
        side: () => this.about.images.map((_, k) => new Pane(this.view, () => shows("image", k))),
        slider: () => single(() => [
          { bitmap: this.bitmap("image", s().image), to: s().split },
          { bitmap: this.bitmap("image", s().other), from: s().split },
        ]),
        flicker: () => single(() => shows("image", s().shown)),
        difference: () => single(() => shows("difference", s().image)),
        flip: () => single(() => shows("flip", s().image)),
      }[this.state.view]();
      const hadFocus = this.panesElement.contains(document.activeElement);
      this.panesElement.replaceChildren(...this.panes.map((p) => p.element));
      this.divider = this.state.view === "slider" ? this.addDivider() : null;
      this.panes.forEach((pane) => this.listen?.(pane));
      if (hadFocus) this.panes[0].canvas.focus({ preventScroll: true });
      this.layout();
    }

    addDivider() {
      const divider = document.createElement("div");
      divider.className = "divider";
      divider.tabIndex = 0;
      divider.setAttribute("role", "slider");
      divider.setAttribute("aria-label", "Line between the two images");
      divider.setAttribute("aria-valuemin", "0");
      divider.setAttribute("aria-valuemax", "100");
      this.panes[0].element.append(divider);
      return divider;
    }

    layout() {
      if (this.panes.length === 0) return;
      const width = this.panesElement.clientWidth;
      const fitting = Math.max(1, Math.floor(width / NARROWEST));
      this.panesElement.style.setProperty("--columns", Math.min(this.panes.length, fitting));
      this.panes.forEach((pane) => pane.layout());
      if (this.view.zoom !== null) this.view.moveTo(this.view.centre);
      this.show();
    }

    show() {
      if (this.isPending) return;
      this.isPending = true;
      requestAnimationFrame(() => {
        this.isPending = false;
        this.draw();
      });
    }

    draw() {
      const { view, image, other, shown, split, scale } = this.state;
      const titles = {
        side: (k) => [this.name(k)],
        slider: () => [this.name(image), this.name(other)],
        flicker: () => [this.name(shown)],
        difference: () => [`${this.name(image)} minus ${this.name(other)}`],
        flip: () => [`FLIP of ${this.name(image)} against ${this.name(this.about.reference)}`],
      };
      this.panes.forEach((pane, k) => {
        pane.title(...titles[view](k));
        // a finger scrolls the page as long as there is nothing to move
        pane.element.classList.toggle("owns-touch", this.view.zoom !== null);
        pane.draw(this.state);
      });
      if (this.divider) {
        const canvas = this.panes[0].canvas;
        this.divider.style.left = `${canvas.offsetLeft + canvas.clientLeft + split * this.view.pane[0]}px`;
        this.divider.style.height = `${canvas.offsetHeight}px`;
        this.divider.setAttribute("aria-valuenow", Math.round(100 * split));
      }
      this.drawLegend(view, scale);
      this.changed();
    }

    drawLegend(view, scale) {
      const legend = this.element.querySelector("[data-legend]");
      legend.hidden = view !== "difference" && view !== "flip";
      if (legend.hidden) return;
      const isSigned = view === "difference";
      const set = (name, text) => { legend.querySelector(`[data-legend-${name}]`).textContent = text; };
      set("low", isSigned ? `−${scale} (darker than the other image)` : "0 (looks the same)");
      set("high", isSigned ? `+${scale} (brighter)` : "1 (as different as can be)");
      set("note", this.about.has_mask ? "Pixels without colour are not counted; magenta: not finite" : "Magenta: not finite");
      report.drawPalette(legend.querySelector("canvas"), isSigned ? "signed" : "heat");
    }

    // Values of the pixel, as the files have them; `null` without a pixel.
    values() {
      const { pixel } = this.state;
      if (!pixel || !this.pixels) return null;
      const { size, reference } = this.about;
      const at = pixel[1] * size[0] + pixel[0];
      const { images, mask } = this.pixels;
      return {
        counts: mask === null || mask[at] !== 0,
        images: images.map((image) => ({
          values: image.planes.map((plane) => plane[at]),
          differences: image.planes.map((plane, c) => plane[at] - images[reference].planes[c][at]),
          flip: image.flip === null ? null : image.flip[at],
        })),
      };
    }
  };
})();
