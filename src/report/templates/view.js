// What panes share: which part of the images they show, and how large. A pane is a canvas with a caption.
(() => {
  "use strict";
  const report = window.skylitReport;
  const MAX_ZOOM = 128;

  // Zoom is in CSS pixels a pixel of the image; `null` fits the whole image in.
  report.View = class {
    constructor(size) {
      this.size = size;
      this.fit();
      this.pane = [1, 1];
    }

    fit() {
      this.zoom = null;
      this.centre = this.size.map((s) => s / 2);
    }

    fitting() {
      return Math.min(this.pane[0] / this.size[0], this.pane[1] / this.size[1]);
    }

    scale() {
      return this.zoom ?? this.fitting();
    }

    toImage([x, y]) {
      return [this.centre[0] + (x - this.pane[0] / 2) / this.scale(), this.centre[1] + (y - this.pane[1] / 2) / this.scale()];
    }

    toPane([x, y]) {
      return [this.pane[0] / 2 + (x - this.centre[0]) * this.scale(), this.pane[1] / 2 + (y - this.centre[1]) * this.scale()];
    }

    // Zooms by a factor so that the point of the image under `at`, in pixels of the pane, stays there.
    zoomBy(factor, at = this.pane.map((s) => s / 2)) {
      const before = this.toImage(at);
      const zoom = Math.min(MAX_ZOOM, this.scale() * factor);
      if (zoom <= this.fitting() * 1.0001) {
        this.fit();
        return;
      }
      this.zoom = zoom;
      const after = this.toImage(at);
      this.moveTo([0, 1].map((k) => this.centre[k] + before[k] - after[k]));
    }

    moveBy([x, y]) {
      this.moveTo([this.centre[0] - x / this.scale(), this.centre[1] - y / this.scale()]);
    }

    // The centre stays where the image fills the pane, or in its middle where it is smaller.
    moveTo(centre) {
      this.centre = centre.map((c, k) => {
        const half = this.pane[k] / 2 / this.scale();
        return half * 2 >= this.size[k] ? this.size[k] / 2 : Math.min(this.size[k] - half, Math.max(half, c));
      });
    }

    showRegion([x, y, width, height]) {
      this.zoom = Math.min(MAX_ZOOM, 0.8 * Math.min(this.pane[0] / width, this.pane[1] / height));
      if (this.zoom <= this.fitting()) this.fit();
      else this.moveTo([x + width / 2, y + height / 2]);
    }
  };

  // A canvas of which `layers()` says what it shows: [{ bitmap, from, to }], from and to being shares of its width.
  report.Pane = class {
    constructor(view, layers) {
      this.view = view;
      this.layers = layers;
      this.element = document.createElement("figure");
      this.element.className = "pane";
      this.canvas = document.createElement("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "img");
      this.caption = document.createElement("figcaption");
      this.element.append(this.canvas, this.caption);
    }

    title(left, right = "") {
      this.caption.replaceChildren(...[left, right].map((text) => {
        const span = document.createElement("span");
        span.textContent = text;
        return span;
      }));
      this.canvas.setAttribute("aria-label", right ? `${left} and ${right}` : left);
    }

    // As wide as its column, as high as the image is then, and never higher than most of the window.
    layout() {
      const width = Math.max(1, this.element.clientWidth);
      const height = Math.max(120, Math.min(Math.round((width * this.view.size[1]) / this.view.size[0]), Math.round(innerHeight * 0.72)));
      this.canvas.style.height = `${height}px`;
      const inner = [this.canvas.clientWidth, this.canvas.clientHeight];
      this.ratio = devicePixelRatio || 1;
      const pixels = inner.map((s) => Math.max(1, Math.round(s * this.ratio)));
      if (this.canvas.width !== pixels[0] || this.canvas.height !== pixels[1]) [this.canvas.width, this.canvas.height] = pixels;
      this.view.pane = inner;
    }

    draw({ pixel, region }) {
      const context = this.canvas.getContext("2d");
      const { view, ratio } = this;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, view.pane[0], view.pane[1]);
      const scale = view.scale();
      const [x, y] = view.toPane([0, 0]);
      const [width, height] = view.size.map((s) => s * scale);
      // pixels are squares once they are large, and are averaged while they are smaller than those of the screen
      context.imageSmoothingEnabled = scale * ratio < 1;
      context.imageSmoothingQuality = "high";
      for (const { bitmap, from = 0, to = 1 } of this.layers()) {
        context.save();
        context.beginPath();
        context.rect(view.pane[0] * from, 0, view.pane[0] * (to - from), view.pane[1]);
        context.clip();
        context.drawImage(bitmap, x, y, width, height);
        context.restore();
      }
      if (region) {
        const corner = view.toPane(region);
        this.frame(context, corner, [region[2] * scale, region[3] * scale]);
      }
      if (pixel) {
        const corner = view.toPane(pixel);
        const size = Math.max(scale, 7);
        const inset = (size - scale) / 2;
        this.frame(context, corner.map((c) => c - inset), [size, size]);
      }
    }

    frame(context, [x, y], [width, height]) {
      for (const [colour, line] of [["#000", 3], ["#fff", 1]]) {
        context.strokeStyle = colour;
        context.lineWidth = line;
        context.strokeRect(x, y, width, height);
      }
    }

    // Position of a pointer in the pane, CSS pixels.
    position(event) {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left - this.canvas.clientLeft, event.clientY - box.top - this.canvas.clientTop];
    }
  };
})();
