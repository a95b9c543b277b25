/* Figures say their values where somebody points, can be saved, and those over time have a cursor at the player's time. */
(() => {
  "use strict";
  const shared = (window.xoscLateral ??= {});
  const SVG = "http://www.w3.org/2000/svg";

  function shown(value, digits = 3) {
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(digits - 1);
    return String(Number(value.toPrecision(size >= 100 ? digits + 1 : digits)));
  }

  function draw(parent, tag, attributes) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    parent.append(made);
    return made;
  }

  /* Place in a panel <-> value; `text` is "low high" or "low high log". */
  function scale(text, start, end) {
    const [low, high, log] = text.split(" "), [a, b] = [low, high].map((each) => (log ? Math.log(each) : Number(each)));
    return {
      value: (place) => {
        const value = a + ((place - start) / (end - start)) * (b - a);
        return log ? Math.exp(value) : value;
      },
      place: (value) => start + (((log ? Math.log(value) : value) - a) / (b - a)) * (end - start),
    };
  }

  class Panel {
    constructor(svg, overTime) {
      const [width, height] = ["width", "height"].map((side) => Number(svg.getAttribute(side)));
      Object.assign(this, { svg, overTime, width, height });
      this.x = scale(svg.dataset.x, 0, width);
      this.y = scale(svg.dataset.y, height, 0);
      this.over = draw(svg, "g", { class: "over" });
      if (overTime && shared.clock) {
        this.cursor = draw(svg, "line", { class: "cursor", y1: 0, y2: height });
        shared.clock.listeners.push(() => this.drawCursor());
        this.drawCursor();
      }
    }

    drawCursor() {
      const at = this.x.place(shared.clock.time);
      this.cursor.setAttribute("x1", at);
      this.cursor.setAttribute("x2", at);
    }

    /* Every labelled line, or group of dots, with its points as they are drawn. */
    lines() {
      return [...this.svg.querySelectorAll("[data-label]")].map((node) => {
        const dots = [...node.children].map((dot) => [Number(dot.getAttribute("cx")), Number(dot.getAttribute("cy"))]);
        const path = (node.getAttribute("d") ?? "").split(/[ML]/).slice(1).map((each) => each.trim().split(" ").map(Number));
        const color = node.getAttribute("stroke") ?? node.getAttribute("fill");
        return { label: node.dataset.label, color, isDots: dots.length > 0, points: dots.length ? dots : path };
      });
    }

    /* Each one's nearest point to the place: along x on a line, in both directions among dots. */
    points([u, v]) {
      const found = this.lines().map(({ label, color, isDots, points }) => {
        const off = ([x, y]) => (isDots ? Math.hypot(x - u, y - v) : Math.abs(x - u));
        const point = points.reduce((best, each) => (off(each) < off(best) ? each : best), [Infinity, Infinity]);
        return { label, color, point, off: off(point) };
      });
      const near = found.filter(({ off, point }) => off < 12 && point[1] >= 0 && point[1] <= this.height);
      return near.sort((a, b) => Math.abs(a.point[1] - v) - Math.abs(b.point[1] - v)).slice(0, 8).sort((a, b) => a.point[1] - b.point[1]);
    }
  }

  /* ---- saving: the figure as picture, its lines as a table ---- */
  function download(name, blob) {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  function picture(svg) {
    const style = getComputedStyle(document.documentElement), copy = svg.cloneNode(true), { width, height } = svg.viewBox.baseVal;
    for (const extra of copy.querySelectorAll(".over, .cursor")) extra.remove();
    for (const [name, value] of [["xmlns", SVG], ["width", width], ["height", height]]) copy.setAttribute(name, value);
    const back = draw(copy, "rect", { width: "100%", height: "100%", fill: "var(--paper)" });
    copy.prepend(back);
    const text = new XMLSerializer().serializeToString(copy);
    return text.replace(/var\((--[\w-]+)\)/g, (_, name) => style.getPropertyValue(name).trim().replaceAll('"', "'"));
  }

  function savePng(name, svg) {
    const { width, height } = svg.viewBox.baseVal, image = new Image(), scale = 3; // 216 dots an inch of a text column
    image.onload = () => {
      const canvas = Object.assign(document.createElement("canvas"), { width: scale * width, height: scale * height });
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob((blob) => download(`${name}.png`, blob));
    };
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(picture(svg))}`;
  }

  /* Every labelled line or dot as it is drawn: panel, label, x, y. */
  function table(panels) {
    const cell = (text) => `"${String(text).replaceAll('"', '""').replace(/^[=+\-@]/, "'$&")}"`;
    const rows = panels.flatMap((panel) => panel.lines().flatMap(({ label, points }) => points.map(([u, v]) =>
      [cell(panel.svg.dataset.title ?? ""), cell(label), shown(panel.x.value(u), 6), shown(panel.y.value(v), 6)].join(","))));
    const { xLabel, yLabel } = panels.find(({ svg }) => svg.dataset.yLabel)?.svg.dataset ?? panels[0].svg.dataset;
    return ["panel,line," + [xLabel ?? "x", yLabel ?? "y"].map(cell).join(","), ...rows, ""].join("\n");
  }

  function addSaving(figure, panels, number) {
    const svg = figure.querySelector(".scroll > svg"), caption = figure.querySelector("figcaption");
    if (!svg || !panels.length || !caption) return;
    const name = `${document.title.replace(/[^\w.-]+/g, "_").slice(0, 60)}_${number}`, bar = document.createElement("span");
    bar.className = "save";
    const kinds = {
      SVG: () => download(`${name}.svg`, new Blob([picture(svg)], { type: "image/svg+xml" })),
      PNG: () => savePng(name, svg),
      CSV: () => download(`${name}.csv`, new Blob([table(panels)], { type: "text/csv" })),
    };
    bar.append("Save as ");
    for (const [kind, action] of Object.entries(kinds)) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: kind });
      button.addEventListener("click", (event) => [event.stopPropagation(), action()]);
      bar.append(button);
    }
    caption.append(bar);
  }

  shared.panels = [];
  let number = 0;
  for (const figure of document.querySelectorAll("figure")) {
    const panels = [...figure.querySelectorAll("svg.panel")].map((svg) => new Panel(svg, figure.classList.contains("time")));
    addSaving(figure, panels, (number += 1));
    const tip = figure.appendChild(document.createElement("div"));
    Object.assign(tip, { className: "tip", hidden: true });
    const hide = () => {
      tip.hidden = true;
      for (const panel of panels) panel.over.replaceChildren();
    };
    const under = (event) => {
      for (const panel of panels) {
        const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(panel.svg.getScreenCTM().inverse());
        if (x >= 0 && x <= panel.width && y >= 0 && y <= panel.height) return [panel, [x, y]];
      }
      return [null, null];
    };
    figure.addEventListener("pointermove", (event) => {
      hide();
      const [panel, place] = under(event), found = panel ? panel.points(place) : [];
      if (!found.length) return;
      const { xLabel, yLabel } = panel.svg.dataset, at = found[0].point[0];
      draw(panel.over, "line", { x1: at, x2: at, y1: 0, y2: panel.height });
      const rows = found.flatMap(({ label, color, point }) => {
        draw(panel.over, "circle", { cx: point[0], cy: point[1], r: 3, fill: color });
        const [term, value] = ["dt", "dd"].map((tag) => document.createElement(tag));
        term.append(Object.assign(document.createElement("i"), { style: `background:${color}` }), label);
        value.append(shown(panel.y.value(point[1])));
        return [term, value];
      });
      const head = document.createElement("strong"), list = document.createElement("dl");
      head.append(`${xLabel ?? "x"} ${shown(panel.x.value(at))}${yLabel ? `, ${yLabel}` : ""}`);
      list.append(...rows);
      tip.replaceChildren(head, list);
      tip.hidden = false;
      const box = figure.getBoundingClientRect(), left = event.clientX - box.left, room = box.width - tip.offsetWidth - 4;
      tip.style.left = `${left + 14 > room ? Math.max(0, left - tip.offsetWidth - 14) : left + 14}px`;
      tip.style.top = `${event.clientY - box.top + 14}px`;
    });
    figure.addEventListener("pointerleave", hide);
    figure.addEventListener("click", (event) => {
      const [panel, place] = under(event);
      if (panel?.overTime && shared.clock) shared.clock.set(panel.x.value(place[0]));
    });
    shared.panels.push(...panels);
  }
})();
