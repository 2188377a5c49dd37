// Pointers, keys and controls of the comparisons of a page.
(() => {
  "use strict";
  const report = window.skylitReport;
  const PERIOD = 500;
  const SCALES = [];
  for (let power = -6; power <= 2; power += 1) for (const m of [1, 2, 5]) SCALES.push(Number(`${m}e${power}`));
  let current = null;

  function use(comparison) {
    current = comparison;
  }

  function setPixel(comparison, point, announce = false) {
    const { size } = comparison.about;
    const pixel = point.map(Math.floor);
    if (pixel.some((p, k) => p < 0 || p >= size[k])) return;
    comparison.set({ pixel });
    if (announce) comparison.shouldAnnounce = true;
  }

  // Drags, pinches and taps of a pane.
  function listen(comparison, pane) {
    const { view } = comparison;
    const pointers = new Map();
    let moved = 0;
    const distance = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    const middle = () => { const all = [...pointers.values()]; return [0, 1].map((k) => all.reduce((sum, p) => sum + p[k], 0) / all.length); };
    const { canvas } = pane;
    canvas.addEventListener("pointerdown", (event) => {
      use(comparison);
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, pane.position(event));
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const at = pane.position(event);
      if (!pointers.has(event.pointerId)) {
        if (event.pointerType !== "touch") setPixel(comparison, view.toImage(at));
        return;
      }
      const [before, span] = [middle(), pointers.size > 1 ? distance() : 0];
      pointers.set(event.pointerId, at);
      const after = middle();
      const step = [after[0] - before[0], after[1] - before[1]];
      moved += Math.hypot(...step);
      if (pointers.size > 1 && span > 0) view.zoomBy(distance() / span, after);
      if (moved > 3) {
        canvas.classList.add("moving");
        view.moveBy(step);
      }
      comparison.show();
    });
    const release = (event) => {
      const wasTap = pointers.size === 1 && moved <= 3 && event.type === "pointerup";
      pointers.delete(event.pointerId);
      if (pointers.size === 0) canvas.classList.remove("moving");
      if (wasTap) setPixel(comparison, view.toImage(pane.position(event)));
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return;
      event.preventDefault();
      view.zoomBy(2 ** (-event.deltaY / (event.deltaMode === 0 ? 300 : 6)), pane.position(event));
      comparison.show();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => arrows(comparison, event));
    if (comparison.divider) listenToDivider(comparison, pane);
  }

  function listenToDivider(comparison, pane) {
    const { divider } = comparison;
    const split = (value) => comparison.set({ split: Math.min(1, Math.max(0, value)) });
    divider.addEventListener("pointerdown", (event) => {
      use(comparison);
      divider.setPointerCapture(event.pointerId);
    });
    divider.addEventListener("pointermove", (event) => {
      if (divider.hasPointerCapture(event.pointerId)) split(pane.position(event)[0] / comparison.view.pane[0]);
    });
    divider.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowDown: -0.02, ArrowRight: 0.02, ArrowUp: 0.02, PageUp: 0.1, PageDown: -0.1, Home: -1, End: 1 }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      split(comparison.state.split + step);
    });
  }

  function arrows(comparison, event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (event.shiftKey) {
      const from = comparison.state.pixel ?? comparison.view.centre.map(Math.floor);
      setPixel(comparison, [from[0] + step[0], from[1] + step[1]], true);
    } else {
      comparison.view.moveBy(step.map((s) => -40 * s));
      comparison.show();
    }
  }

  // The controls say what is shown.
  function update(comparison) {
    const { element, state, about, view } = comparison;
    for (const button of element.querySelectorAll("[data-view]")) {
      const isChosen = button.dataset.view === state.view;
      button.setAttribute("aria-checked", isChosen);
      button.tabIndex = isChosen ? 0 : -1;
    }
    for (const label of element.querySelectorAll(".choices label")) label.hidden = !label.dataset.for.split(" ").includes(state.view);
    const choice = (name) => element.querySelector(`[data-choice=${name}]`);
    for (const name of ["image", "other", "channel", "exposure"]) if (choice(name)) choice(name).value = state[name];
    choice("alternate").checked = state.alternate;
    const scale = choice("scale");
    if (!SCALES.includes(state.scale)) SCALES.push(state.scale);
    if (scale.options.length !== SCALES.length) scale.replaceChildren(...SCALES.map((s) => new Option(String(s), s)));
    scale.value = state.scale;
    const show = (name, text) => { element.querySelector(`[data-show=${name}]`).textContent = text; };
    show("exposure", `${state.exposure > 0 ? "+" : ""}${state.exposure} EV`);
    show("zoom", `${Math.round(100 * view.scale() * (devicePixelRatio || 1))} %`);
    readout(comparison, about);
  }

  function readout(comparison, { reference }) {
    const values = comparison.values();
    if (!values) return;
    const { element, state } = comparison;
    const [x, y] = state.pixel;
    element.querySelector("[data-pixel]").textContent = `Pixel ${x}, ${y}${values.counts ? "" : " (not counted)"}`;
    const short = (v) => (Number.isFinite(v) ? `${v >= 0 ? "+" : "−"}${Number(Math.abs(v).toPrecision(4))}` : String(v));
    for (const row of element.querySelectorAll("[data-image]")) {
      const k = Number(row.dataset.image);
      const image = values.images[k];
      row.querySelectorAll("[data-value-of]").forEach((cell, c) => { cell.textContent = report.formatFloat(image.values[c]); });
      row.querySelectorAll("[data-difference-of]").forEach((cell, c) => { cell.textContent = k === reference ? "" : short(image.differences[c]); });
      const flip = row.querySelector("[data-flip]");
      if (flip) flip.textContent = image.flip === null ? "–" : Number(image.flip.toPrecision(3));
    }
    if (comparison.shouldAnnounce) {
      comparison.shouldAnnounce = false;
      const said = values.images.map((image, k) => `${comparison.name(k)}: ${image.values.map(report.formatFloat).join(" ")}`);
      element.querySelector("[data-announce]").textContent = `Pixel ${x}, ${y}. ${said.join(". ")}`;
    }
  }

  const actions = {
    "zoom-in": (c) => c.view.zoomBy(2),
    "zoom-out": (c) => c.view.zoomBy(0.5),
    fit: (c) => c.view.fit(),
    actual: (c) => c.view.zoomBy(1 / (devicePixelRatio || 1) / c.view.scale()),
    help: () => document.getElementById("help").showModal(),
  };

  function act(comparison, name) {
    use(comparison);
    actions[name](comparison);
    if (comparison.panes.length > 0) comparison.show();
  }

  // Shows the other image of the two, once.
  function flicker(comparison, isAutomatic = false) {
    const { view, image, other, shown } = comparison.state;
    if (view === "flicker") comparison.set({ shown: shown === image ? other : image, ...(isAutomatic ? {} : { alternate: false }) });
    else comparison.set({ view: "flicker", shown: image });
  }

  const views = { s: "side", w: "slider", d: "difference", p: "flip" };
  const keys = { "+": "zoom-in", "=": "zoom-in", "-": "zoom-out", 0: "fit", "?": "help" };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("select, dialog, input[type=text]")) return;
    const comparison = current ?? [...report.comparisons.values()].find((c) => c.pixels);
    if (!comparison) return;
    const { about, state } = comparison;
    const key = event.key.toLowerCase();
    const number = Number(event.key);
    if (key in views && (key !== "p" || about.has_flip)) comparison.set({ view: views[key] });
    else if (key === "f") flicker(comparison);
    else if (event.key in keys) act(comparison, keys[event.key]);
    else if (event.key === "[" || event.key === "]") changeExposure(comparison, event.key === "]" ? 0.5 : -0.5);
    else if (number >= 1 && number <= about.images.length) {
      if (state.view === "difference" || state.view === "flip") comparison.set({ image: number - 1 });
      else comparison.set({ view: "flicker", shown: number - 1, alternate: false });
    } else return;
    event.preventDefault();
  });

  function changeExposure(comparison, step) {
    comparison.set({ exposure: Math.min(10, Math.max(-10, comparison.state.exposure + step)) });
  }

  function connect(comparison) {
    const { element } = comparison;
    comparison.listen = (pane) => listen(comparison, pane);
    comparison.changed = () => update(comparison);
    const buttons = [...element.querySelectorAll("[data-view]")];
    for (const button of buttons) {
      button.addEventListener("click", () => {
        use(comparison);
        comparison.set({ view: button.dataset.view });
      });
      // a group of radio buttons is moved through by arrows
      button.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
        if (!step) return;
        event.preventDefault();
        const next = buttons[(buttons.indexOf(button) + step + buttons.length) % buttons.length];
        comparison.set({ view: next.dataset.view });
        next.focus();
      });
    }
    for (const button of element.querySelectorAll("[data-action]")) button.addEventListener("click", () => act(comparison, button.dataset.action));
    for (const control of element.querySelectorAll("[data-choice]")) {
      control.addEventListener("input", () => {
        use(comparison);
        const name = control.dataset.choice;
        const value = control.type === "checkbox" ? control.checked : Number(control.value);
        comparison.set(name === "image" ? { image: value, shown: value } : { [name]: value });
      });
    }
    for (const button of element.closest("section").querySelectorAll("[data-region]")) {
      button.addEventListener("click", () => {
        use(comparison);
        const region = button.dataset.region.split(",").map(Number);
        element.scrollIntoView({ block: "nearest" });
        comparison.view.showRegion(region);
        comparison.set({ region });
      });
    }
  }

  setInterval(() => {
    if (document.hidden) return;
    for (const comparison of report.comparisons.values()) {
      if (comparison.pixels && comparison.state.view === "flicker" && comparison.state.alternate) flicker(comparison, true);
    }
  }, PERIOD);

  // Pixels are loaded when they come near to what the window shows.
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting) continue;
      observer.unobserve(target);
      report.comparisons.get(target.id).load();
    }
  }, { rootMargin: "400px" });
  for (const element of document.querySelectorAll(".images")) {
    const comparison = new report.Comparison(element);
    report.comparisons.set(element.id, comparison);
    connect(comparison);
    observer.observe(element);
  }
})();
