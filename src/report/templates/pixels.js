// Pixels of images, from the text of data/*.js to numbers. A file is loaded as a script, because a page from disk may not read files otherwise.
(() => {
  "use strict";
  const report = window.skylitReport;
  const waiting = new Map();

  // Called by data/*.js.
  report.receive = (key, pixels) => waiting.get(key)?.(pixels);

  async function inflate(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // Four planes of bytes, the least significant first, to floats.
  async function floats(text) {
    const bytes = await inflate(text);
    const count = bytes.length / 4;
    const together = new Uint8Array(bytes.length);
    for (let plane = 0; plane < 4; plane += 1) {
      for (let k = 0, at = plane * count; k < count; k += 1, at += 1) together[4 * k + plane] = bytes[at];
    }
    const view = new DataView(together.buffer);
    const isLittleEndian = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;
    return isLittleEndian ? new Float32Array(together.buffer) : Float32Array.from({ length: count }, (_, k) => view.getFloat32(4 * k, true));
  }

  // Loads the pixels of a comparison: { images: [{ planes: [Float32Array a channel], flip }], mask }.
  report.loadPixels = async (key, source, channels) => {
    const received = new Promise((resolve, reject) => {
      waiting.set(key, resolve);
      const script = document.createElement("script");
      script.src = source;
      script.onerror = () => reject(new Error(`${source} is missing: copy the whole folder of the report`));
      document.head.append(script);
    });
    const pixels = await received;
    waiting.delete(key);
    if (!("DecompressionStream" in window)) throw new Error("this browser cannot decompress data (DecompressionStream): use a newer one");
    const images = await Promise.all(pixels.images.map(async (image) => {
      const all = await floats(image.values);
      const size = all.length / channels;
      const planes = Array.from({ length: channels }, (_, c) => all.subarray(c * size, (c + 1) * size));
      return { planes, flip: image.flip === null ? null : await floats(image.flip) };
    }));
    return { images, mask: pixels.mask === null ? null : await inflate(pixels.mask) };
  };
})();
