// The page apart from its images: theme, copying, sorting of tables, links into folded sections.
(() => {
  "use strict";
  const root = document.documentElement;

  // Browsers that keep nothing for files make the choice last as long as the page.
  const stored = {
    get: () => { try { return localStorage.getItem("skylit-theme"); } catch { return null; } },
    set: (value) => { try { localStorage.setItem("skylit-theme", value); } catch { /* not kept */ } },
  };
  const themes = { system: ["light dark", "◐", "as the system"], light: ["light", "☀", "light"], dark: ["dark", "☾", "dark"] };
  const button = document.querySelector("[data-theme-toggle]");
  let theme = stored.get() in themes ? stored.get() : "system";
  function applyTheme() {
    const [scheme, sign, name] = themes[theme];
    root.style.colorScheme = scheme;
    button.textContent = sign;
    button.title = `Theme: ${name}`;
    button.setAttribute("aria-label", button.title);
  }
  applyTheme();
  button.addEventListener("click", () => {
    const names = Object.keys(themes);
    theme = names[(names.indexOf(theme) + 1) % names.length];
    stored.set(theme);
    applyTheme();
  });

  for (const copy of document.querySelectorAll("[data-copy]")) {
    copy.addEventListener("click", async () => {
      const code = copy.parentElement.querySelector("code");
      try {
        await navigator.clipboard.writeText(code.textContent);
        copy.textContent = "Copied";
      } catch {
        // pages from disk may not write to the clipboard: the text is selected for the reader to copy
        getSelection().selectAllChildren(code);
        copy.textContent = "Selected";
      }
      setTimeout(() => { copy.textContent = "Copy"; }, 2000);
    });
  }

  // Numbers from large to small first, text from A to Z; rows without a number come last.
  function sort(table, column, heading) {
    const body = table.tBodies[0];
    const rows = [...body.rows];
    const cell = (row) => row.cells[column];
    const isNumeric = rows.some((row) => cell(row).dataset.value !== undefined);
    const before = heading.getAttribute("aria-sort");
    const first = isNumeric ? "descending" : "ascending";
    const order = before === first ? (first === "ascending" ? "descending" : "ascending") : first;
    const sign = order === "ascending" ? 1 : -1;
    const number = (row) => { const v = Number(cell(row).dataset.value ?? NaN); return Number.isNaN(v) ? sign * Infinity : v; };
    rows.sort((a, b) => {
      if (!isNumeric) return sign * cell(a).textContent.localeCompare(cell(b).textContent);
      const [x, y] = [number(a), number(b)];
      return x === y ? 0 : sign * (x < y ? -1 : 1);
    });
    body.append(...rows);
    for (const other of heading.parentElement.cells) {
      if (other.hasAttribute("aria-sort")) other.setAttribute("aria-sort", "none");
    }
    heading.setAttribute("aria-sort", order);
  }
  for (const table of document.querySelectorAll("table.data")) {
    for (const control of table.querySelectorAll("[data-sort]")) {
      control.addEventListener("click", () => sort(table, Number(control.dataset.sort), control.closest("th")));
    }
  }

  function openTarget() {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const details = target && target.querySelector(":scope > details");
    if (details) details.open = true;
  }
  addEventListener("hashchange", openTarget);
  openTarget();
})();
