/* Long tables: a field that filters their rows, and headings that sort them. */
(() => {
  "use strict";
  function sorted(rows, column, isDown) {
    const value = (row) => row.cells[column].textContent.trim();
    const isNumber = rows.every((row) => row.cells[column].classList.contains("number"));
    const order = (a, b) => {
      if (!isNumber) return a.localeCompare(b, "en", { numeric: true });
      const [x, y] = [a, b].map((each) => parseFloat(each));
      return isNaN(x) ? (isNaN(y) ? 0 : 1) : isNaN(y) ? -1 : x - y;
    };
    return [...rows].sort((a, b) => (isDown ? -1 : 1) * order(value(a), value(b)));
  }

  for (const frame of document.querySelectorAll(".table.long")) {
    const body = frame.querySelector("tbody"), rows = [...body.rows], headings = [...frame.querySelectorAll("thead th")];
    const field = Object.assign(document.createElement("input"), { type: "search", placeholder: "Filter rows" });
    field.setAttribute("aria-label", "Filter rows");
    const count = document.createElement("output"), bar = document.createElement("div");
    bar.className = "filter";
    bar.append(field, count);
    frame.before(bar);
    const filter = () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      for (const row of rows) {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
        shown += !row.hidden;
      }
      count.textContent = `${shown} of ${rows.length}`;
    };
    field.addEventListener("input", filter);
    filter();
    headings.forEach((heading, column) => {
      const button = document.createElement("button");
      button.append(...heading.childNodes);
      heading.append(button);
      button.addEventListener("click", () => {
        const isDown = heading.getAttribute("aria-sort") === "ascending";
        headings.forEach((each) => each.removeAttribute("aria-sort"));
        heading.setAttribute("aria-sort", isDown ? "descending" : "ascending");
        body.append(...sorted(rows, column, isDown));
      });
    });
  }
})();
