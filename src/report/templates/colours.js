// Numbers to colours: linear values by exposure and the sRGB transfer function, differences and FLIP by palettes.
(() => {
  "use strict";
  const report = window.skylitReport;

  const STEPS = 16384;
  const srgb = Uint8Array.from({ length: STEPS + 1 }, (_, k) => {
    const v = k / STEPS;
    return Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
  });
  const luminance = (planes, k) => (planes.length === 3 ? 0.2126 * planes[0][k] + 0.7152 * planes[1][k] + 0.0722 * planes[2][k] : planes[0][k]);

  // 1024 colours, four bytes each, between those of a palette.
  const TABLE = 1024;
  function table(colours) {
    const bytes = new Uint8Array(4 * TABLE);
    for (let i = 0; i < TABLE; i += 1) {
      const at = (i / (TABLE - 1)) * (colours.length - 1);
      const k = Math.min(Math.floor(at), colours.length - 2);
      for (let c = 0; c < 3; c += 1) bytes[4 * i + c] = Math.round(colours[k][c] + (colours[k + 1][c] - colours[k][c]) * (at - k));
      bytes[4 * i + 3] = 255;
    }
    return bytes;
  }
  const palettes = report.palettes && { heat: table(report.palettes.heat), signed: table(report.palettes.signed) };

  function bitmap([width, height], fill) {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d");
    const data = context.createImageData(width, height);
    fill(data.data);
    context.putImageData(data, 0, 0);
    return canvas;
  }

  const MAGENTA = [255, 0, 255];

  // An image, brightened by `exposure` stops; what is not finite is magenta.
  report.imageBitmap = (size, planes, exposure) => bitmap(size, (out) => {
    const gain = 2 ** exposure * STEPS;
    const [r, g, b] = planes.length === 3 ? planes : [planes[0], planes[0], planes[0]];
    for (let k = 0, o = 0; k < r.length; k += 1, o += 4) {
      const isFinite = Number.isFinite(r[k] + g[k] + b[k]);
      const code = (v) => srgb[Math.min(STEPS, Math.max(0, Math.round(v * gain)))];
      if (isFinite) {
        out[o] = code(r[k]);
        out[o + 1] = code(g[k]);
        out[o + 2] = code(b[k]);
      } else [out[o], out[o + 1], out[o + 2]] = MAGENTA;
      out[o + 3] = 255;
    }
  });

  function paint(out, count, mask, colours, position) {
    for (let k = 0, o = 0; k < count; k += 1, o += 4) {
      if (mask !== null && mask[k] === 0) continue;
      const t = position(k);
      if (Number.isNaN(t)) [out[o], out[o + 1], out[o + 2]] = MAGENTA;
      else {
        const i = 4 * Math.round(Math.min(1, Math.max(0, t)) * (TABLE - 1));
        out[o] = colours[i];
        out[o + 1] = colours[i + 1];
        out[o + 2] = colours[i + 2];
      }
      out[o + 3] = 255;
    }
  }

  // Image minus other; `scale` has the full colour. `channel` -1: luminance. Pixels outside of the mask are transparent.
  report.differenceBitmap = (size, image, other, channel, scale, mask) => bitmap(size, (out) => {
    const value = channel < 0 ? luminance : (planes, k) => planes[channel][k];
    paint(out, size[0] * size[1], mask, palettes.signed, (k) => 0.5 + (0.5 * (value(image, k) - value(other, k))) / scale);
  });

  report.flipBitmap = (size, flip, mask) => bitmap(size, (out) => paint(out, flip.length, mask, palettes.heat, (k) => flip[k]));

  // The palette from left to right, on a canvas 1 pixel high or more.
  report.drawPalette = (canvas, name) => {
    const context = canvas.getContext("2d");
    for (let x = 0; x < canvas.width; x += 1) {
      const i = 4 * Math.round((x / (canvas.width - 1)) * (TABLE - 1));
      context.fillStyle = `rgb(${palettes[name].slice(i, i + 3).join(",")})`;
      context.fillRect(x, 0, 1, canvas.height);
    }
  };

  // A difference that all but one pixel in a hundred stay below, rounded up to 1, 2 or 5 times a power of ten.
  report.typicalDifference = (image, other, channel, mask) => {
    const count = image[0].length;
    const step = Math.max(1, Math.floor(count / 20000));
    const sizes = [];
    const value = channel < 0 ? luminance : (planes, k) => planes[channel][k];
    for (let k = 0; k < count; k += step) {
      const d = Math.abs(value(image, k) - value(other, k));
      if (Number.isFinite(d) && (mask === null || mask[k] !== 0)) sizes.push(d);
    }
    sizes.sort((a, b) => a - b);
    const high = sizes[Math.floor(0.99 * (sizes.length - 1))] || 0;
    if (!(high > 1e-9)) return 0.01;
    const power = 10 ** Math.floor(Math.log10(high));
    return Number(([1, 2, 5, 10].find((m) => m * power >= high * (1 - 1e-9)) * power).toPrecision(1));
  };

  // The shortest decimal that is the same 32-bit float.
  report.formatFloat = (value) => {
    if (!Number.isFinite(value)) return String(value);
    for (let digits = 1; digits < 9; digits += 1) {
      const text = value.toPrecision(digits);
      if (Math.fround(Number(text)) === value) return String(Number(text));
    }
    return String(Number(value.toPrecision(9)));
  };
})();
