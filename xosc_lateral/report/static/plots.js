/* Figures that can be zoomed and that give their values: works on the pictures themselves, so print stays as it is. */
(() => {
  "use strict";
  const shared = (window.xoscLateral ??= {});
  const plots = (shared.plots = []);
  const SVG = "http://www.w3.org/2000/svg";
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  function element(tag, attributes = {}, parent = null) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    parent?.appendChild(made);
    return made;
  }

  function shown(value) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2);
    return String(Number(value.toPrecision(size >= 100 ? 4 : 3)));
  }

  /* One direction of one pair of axes: data <-> picture <-> zoomed picture. */
  class Scale {
    constructor(low, high, start, end, isLog) {
      Object.assign(this, { low, high, start, end, isLog, from: start, to: end });
    }

    get isZoomed() {
      return this.from !== this.start || this.to !== this.end;
    }

    get factor() {
      return (this.end - this.start) / (this.to - this.from);
    }

    get shift() {
      return this.start - this.from * this.factor;
    }

    /* Place in the original picture <-> value. */
    value(place) {
      const share = (place - this.start) / (this.end - this.start);
      if (!this.isLog) return this.low + share * (this.high - this.low);
      return this.low * (this.high / this.low) ** share;
    }

    place(value) {
      const share = this.isLog
        ? Math.log(value / this.low) / Math.log(this.high / this.low)
        : (value - this.low) / (this.high - this.low);
      return this.start + share * (this.end - this.start);
    }

    out(place) {
      return place * this.factor + this.shift;
    }

    back(place) {
      return (place - this.shift) / this.factor;
    }

    /* Show the part between two places of the original picture; never more than it all, nor less than a thousandth. */
    show(from, to) {
      const least = Math.abs(this.end - this.start) / 1000, sign = Math.sign(this.end - this.start);
      if (Math.abs(to - from) < least) return;
      const [low, high] = sign > 0 ? [this.start, this.end] : [this.end, this.start];
      this.from = clamp(from, low, high);
      this.to = clamp(to, low, high);
    }

    zoom(factor, about) {
      this.show(about + (this.from - about) / factor, about + (this.to - about) / factor);
    }

    pan(by) {
      const sign = Math.sign(this.end - this.start);
      const room = by * sign > 0 ? (this.end - this.to) * sign : (this.from - this.start) * sign;
      const step = Math.sign(by) * Math.min(Math.abs(by), Math.max(room, 0));
      this.from += step;
      this.to += step;
    }

    ticks() {
      const ends = [this.value(this.from), this.value(this.to)].sort((a, b) => a - b);
      if (this.isLog && ends[1] / ends[0] > 20) {
        const ticks = [];
        for (let e = Math.ceil(Math.log10(ends[0])); e <= Math.log10(ends[1]); e++) ticks.push(10 ** e);
        if (ticks.length > 1) return ticks;
      }
      const rough = (ends[1] - ends[0]) / 6, power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough);
      const ticks = [];
      for (let k = Math.ceil(ends[0] / step); k * step <= ends[1] + 1e-9 * step; k++) ticks.push(Number((k * step).toPrecision(12)));
      return ticks;
    }
  }

  class Axes {
    constructor(plot, data) {
      Object.assign(this, { plot, data });
      const [left, top, right, bottom] = data.box;
      this.x = new Scale(...data.x, left, right, data.xlog);
      this.y = new Scale(...data.y, bottom, top, data.ylog);
      this.group = plot.find(data.id);
      this.parts = [...this.group.querySelectorAll("[clip-path]")].filter((part) => !this.isTick(part)).map((part) => this.wrap(part));
      this.lines = data.lines.map((line) => this.readLine(line)).filter((line) => line && line.points.length);
      this.labels = data.texts.map((text) => ({ ...text, node: plot.find(text.id) })).filter((text) => text.node);
      this.own = element("g", { class: "own" }, this.group);
    }

    isTick(part) {
      return part.closest('[id*="xtick_"], [id*="ytick_"]') !== null;
    }

    /* The clip stays where it is while what it clips is transformed. */
    wrap(part) {
      const clip = element("g", { "clip-path": part.getAttribute("clip-path") });
      const moved = element("g", {}, clip);
      part.replaceWith(clip);
      part.removeAttribute("clip-path");
      moved.appendChild(part);
      const marks = [...part.querySelectorAll("use"), ...(part.tagName === "use" ? [part] : [])];
      const dots = this.data.lines.some((line) => this.plot.find(line.id)?.contains(part)) ? marks : [];
      for (const path of clip.querySelectorAll("path, use")) path.setAttribute("vector-effect", "non-scaling-stroke");
      return { moved, dots: dots.map((node) => ({ node, x: Number(node.getAttribute("x")), y: Number(node.getAttribute("y")) })) };
    }

    readLine(line) {
      const group = this.plot.find(line.id);
      if (!group) return null;
      const points = [];
      for (const path of group.querySelectorAll("path")) {
        if (path.closest("defs")) continue;
        for (const [, command, x, y] of (path.getAttribute("d") ?? "").matchAll(/([ML]) (-?[\d.]+) (-?[\d.]+)/g)) {
          points.push({ x: Number(x), y: Number(y), starts: command === "M" });
        }
      }
      if (!points.length) {
        for (const dot of group.querySelectorAll("use")) {
          points.push({ x: Number(dot.getAttribute("x")), y: Number(dot.getAttribute("y")), starts: true });
        }
      }
      const rising = points.every((point, i) => !i || point.x >= points[i - 1].x);
      return { ...line, points, rising: rising && points.some((point) => !point.starts) };
    }

    /* Value of a line below the pointer: on the line where it runs from left to right, else at its nearest point. */
    read(line, u, v) {
      const { points } = line;
      if (line.rising) {
        let low = 0, high = points.length - 1;
        if (u < points[0].x - 1 || u > points[high].x + 1) return null;
        while (high - low > 1) {
          const middle = (low + high) >> 1;
          if (points[middle].x <= u) low = middle;
          else high = middle;
        }
        const a = points[low], b = points[high];
        if (b.starts && b !== a) return Math.abs(u - a.x) < 2 ? a : Math.abs(u - b.x) < 2 ? b : null;
        const share = b.x > a.x ? clamp((u - a.x) / (b.x - a.x), 0, 1) : 0;
        return { x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y) };
      }
      let best = null, smallest = 14;
      for (const point of points) {
        const distance = Math.hypot((point.x - u) * this.x.factor, (point.y - v) * this.y.factor);
        if (distance < smallest) [best, smallest] = [point, distance];
      }
      return best;
    }

    holds(x, y) {
      const [left, top, right, bottom] = this.data.box;
      return x >= left - 2 && x <= right + 2 && y >= top - 2 && y <= bottom + 2;
    }

    redraw() {
      const { x, y } = this;
      for (const { moved, dots } of this.parts) {
        if (dots.length) {
          for (const dot of dots) {
            dot.node.setAttribute("x", x.out(dot.x));
            dot.node.setAttribute("y", y.out(dot.y));
          }
        } else {
          moved.setAttribute("transform", `matrix(${x.factor} 0 0 ${y.factor} ${x.shift} ${y.shift})`);
        }
      }
      for (const { node, at } of this.labels) {
        const place = [x.out(at[0]), y.out(at[1])];
        node.setAttribute("transform", `translate(${place[0] - at[0]} ${place[1] - at[1]})`);
        node.style.display = this.holds(...place) ? "" : "none";
      }
      this.own.replaceChildren();
      this.ticks("x", x);
      this.ticks("y", y);
    }

    ticks(name, scale) {
      const isOwn = scale.isZoomed && !this.data[`${name}names`];
      for (const tick of this.group.querySelectorAll(`[id*="-${name}tick_"]`)) tick.style.display = isOwn ? "none" : "";
      if (scale.isZoomed && this.data[`${name}names`]) {
        for (const tick of this.group.querySelectorAll(`[id*="-${name}tick_"]`)) tick.style.display = "none";
      }
      if (!isOwn) return;
      const [left, top, right, bottom] = this.data.box;
      for (const value of scale.ticks()) {
        const at = scale.out(scale.place(value));
        const line = name === "x" ? { x1: at, x2: at, y1: top, y2: bottom } : { x1: left, x2: right, y1: at, y2: at };
        this.own.prepend(element("line", { ...line, class: "tick" }));
        if (!this.data[`${name}labels`]) continue;
        const place = name === "x" ? { x: at, y: bottom + 13, "text-anchor": "middle" } : { x: left - 6, y: at + 3, "text-anchor": "end" };
        element("text", place, this.own).textContent = shown(value);
      }
    }
  }

  class Plot {
    constructor(figure) {
      this.figure = figure;
      this.svg = figure.querySelector("svg");
      const data = JSON.parse(figure.dataset.plot);
      this.overTime = Boolean(data.time);
      this.axes = data.axes.map((each) => new Axes(this, each));
      this.over = element("g", { class: "over" }, this.svg);
      this.tip = document.createElement("div");
      this.tip.className = "tip";
      this.tip.hidden = true;
      this.svg.setAttribute("tabindex", "0");
      this.buildButtons();
      figure.append(this.tip);
      this.listen();
      const clock = shared.clock;
      if (this.overTime && clock) clock.listeners.push(() => this.drawCursor());
      this.cursor = element("g", { class: "cursor" }, this.svg);
      this.drawCursor();
    }

    find(id) {
      return this.svg.querySelector(`[id="${id}"]`);
    }

    buildButtons() {
      const bar = document.createElement("div");
      bar.className = "plot-buttons";
      const add = (text, label, action) => {
        const button = document.createElement("button");
        Object.assign(button, { type: "button", textContent: text, title: label });
        button.setAttribute("aria-label", label);
        button.addEventListener("click", action);
        bar.append(button);
      };
      const about = (scale) => (scale.from + scale.to) / 2;
      add("−", "Zoom out", () => this.each((scale) => scale.zoom(1 / 1.5, about(scale))));
      add("+", "Zoom in", () => this.each((scale) => scale.zoom(1.5, about(scale))));
      add("Reset", "Show all", () => this.reset());
      this.figure.prepend(bar);
    }

    /* Axes that move together: those that share an axis, and all that run over time. */
    linked(axes) {
      return this.overTime ? plots.filter((plot) => plot.overTime).flatMap((plot) => plot.axes)
        : this.axes.filter((each) => each === axes || each.data.xgroup === axes.data.xgroup);
    }

    each(change) {
      for (const axes of this.linked(this.axes[0])) change(axes.x);
      this.redrawAll();
    }

    /* The same share of the x axis everywhere, in values where figures over time have different extents. */
    spread(axes) {
      const [a, b] = [axes.x.value(axes.x.from), axes.x.value(axes.x.to)];
      for (const other of this.linked(axes)) if (other !== axes) other.x.show(other.x.place(a), other.x.place(b));
      for (const other of this.axes) {
        if (other !== axes && other.data.ygroup === axes.data.ygroup) {
          const scale = other.y, share = (place) => (place - axes.y.start) / (axes.y.end - axes.y.start);
          const place = (part) => scale.start + part * (scale.end - scale.start);
          scale.show(place(share(axes.y.from)), place(share(axes.y.to)));
        }
      }
      this.redrawAll();
    }

    reset() {
      for (const axes of [...this.axes, ...this.linked(this.axes[0])]) {
        for (const scale of [axes.x, axes.y]) [scale.from, scale.to] = [scale.start, scale.end];
      }
      this.redrawAll();
    }

    redrawAll() {
      for (const plot of this.overTime ? plots.filter((each) => each.overTime) : [this]) plot.redraw();
    }

    redraw() {
      for (const axes of this.axes) axes.redraw();
      this.hide();
      this.drawCursor();
    }

    drawCursor() {
      if (!this.cursor) return;
      this.cursor.replaceChildren();
      if (!this.overTime || !shared.clock || !shared.clock.end) return;
      for (const axes of this.axes) {
        const at = axes.x.out(axes.x.place(shared.clock.time)), [left, top, right, bottom] = axes.data.box;
        if (at >= left - 0.5 && at <= right + 0.5) element("line", { x1: at, x2: at, y1: top, y2: bottom }, this.cursor);
      }
    }

    place(event) {
      const inverse = this.svg.getScreenCTM().inverse();
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(inverse);
      return [point.x, point.y];
    }

    hide() {
      this.tip.hidden = true;
      this.over.replaceChildren();
    }

    listen() {
      let start = null, spread = 0;
      const fingers = new Map();
      const { svg } = this;
      svg.addEventListener("pointerdown", (event) => {
        fingers.set(event.pointerId, this.place(event));
        const axes = this.axes.find((each) => each.holds(...this.place(event)));
        if (event.pointerType === "touch" || event.button !== 0 || !axes) return;
        start = { axes, at: this.place(event), pan: event.shiftKey };
        svg.setPointerCapture(event.pointerId);
      });
      svg.addEventListener("pointermove", (event) => {
        const now = this.place(event);
        if (fingers.has(event.pointerId)) fingers.set(event.pointerId, now);
        if (fingers.size === 2) return this.pinch([...fingers.values()], spread, (value) => (spread = value));
        if (!start) return this.read(now, event);
        if (start.pan) {
          start.axes.x.pan((start.at[0] - now[0]) / start.axes.x.factor);
          start.at = now;
          return this.spread(start.axes);
        }
        this.hide();
        this.drawFrame(start, now);
      });
      const release = (event) => {
        fingers.delete(event.pointerId);
        spread = 0;
        const begun = start;
        start = null;
        const now = this.place(event);
        if (event.type === "pointercancel") return this.hide();
        if (!begun || begun.pan) return;
        this.over.replaceChildren();
        if (Math.hypot(now[0] - begun.at[0], now[1] - begun.at[1]) < 4) this.clicked(begun.axes, now);
        else this.zoomTo(begun, now);
      };
      svg.addEventListener("pointerup", release);
      svg.addEventListener("pointercancel", release);
      svg.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && this.hide());
      svg.addEventListener("click", (event) => event.detail === 2 && this.reset());
      svg.addEventListener("wheel", (event) => {
        const now = this.place(event), axes = this.axes.find((each) => each.holds(...now));
        if (!axes || (!event.ctrlKey && !event.metaKey && document.activeElement !== svg)) return; // else the page scrolls
        event.preventDefault();
        axes.x.zoom(Math.exp(-event.deltaY * 0.0015), axes.x.back(now[0]));
        this.spread(axes);
      }, { passive: false });
      svg.addEventListener("keydown", (event) => {
        const axes = this.axes[0], width = axes.x.to - axes.x.from, middle = (axes.x.to + axes.x.from) / 2;
        const actions = {
          "+": () => axes.x.zoom(1.5, middle), "=": () => axes.x.zoom(1.5, middle), "-": () => axes.x.zoom(1 / 1.5, middle),
          ArrowLeft: () => axes.x.pan(-0.2 * width), ArrowRight: () => axes.x.pan(0.2 * width),
          0: () => this.reset(), Escape: () => this.reset(),
        };
        if (!actions[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        actions[event.key]();
        this.spread(axes);
      });
      window.addEventListener("beforeprint", () => { this.reset(); this.cursor.replaceChildren(); });
      window.addEventListener("afterprint", () => this.drawCursor());
    }

    pinch([a, b], before, keep) {
      const now = Math.abs(a[0] - b[0]), axes = this.axes.find((each) => each.holds(...a)) ?? this.axes[0];
      if (before > 10 && now > 10) {
        axes.x.zoom(now / before, axes.x.back((a[0] + b[0]) / 2));
        this.spread(axes);
      }
      keep(now);
    }

    clicked(axes, now) {
      if (this.overTime && shared.clock?.end) shared.clock.set(axes.x.value(axes.x.back(now[0])));
    }

    selection({ axes, at }, now) {
      const [left, top, right, bottom] = axes.data.box;
      const xs = [at[0], now[0]].map((each) => clamp(each, left, right)).sort((a, b) => a - b);
      const ys = [at[1], now[1]].map((each) => clamp(each, top, bottom)).sort((a, b) => a - b);
      const width = xs[1] - xs[0], height = ys[1] - ys[0];
      const byX = width >= 12 || width >= height, byY = !this.overTime && (height >= 12 || !byX);
      return { xs: byX ? xs : [left, right], ys: byY ? ys : [top, bottom], byX, byY };
    }

    drawFrame(start, now) {
      const { xs, ys } = this.selection(start, now);
      element("rect", { x: xs[0], y: ys[0], width: xs[1] - xs[0], height: ys[1] - ys[0], class: "selection" }, this.over);
    }

    zoomTo(start, now) {
      const { axes } = start, { xs, ys, byX, byY } = this.selection(start, now);
      if (byX) axes.x.show(axes.x.back(xs[0]), axes.x.back(xs[1]));
      if (byY) axes.y.show(axes.y.back(ys[1]), axes.y.back(ys[0]));
      this.spread(axes);
    }

    read(now, event) {
      this.hide();
      const axes = this.axes.find((each) => each.holds(...now));
      if (!axes) return;
      const [u, v] = [axes.x.back(now[0]), axes.y.back(now[1])];
      let found = axes.lines.map((line) => ({ line, point: axes.read(line, u, v) })).filter((each) => each.point);
      found = found.filter(({ point }) => axes.holds(axes.x.out(point.x), axes.y.out(point.y)));
      if (!found.length) return;
      const off = ({ point }) => Math.abs(point.y - v);
      found = found.sort((a, b) => off(a) - off(b)).slice(0, 8).sort((a, b) => a.point.y - b.point.y);
      const [, top, , bottom] = axes.data.box;
      const at = axes.x.out(found.some(({ line }) => line.rising) ? u : found[0].point.x);
      element("line", { x1: at, x2: at, y1: top, y2: bottom, class: "hair" }, this.over);
      for (const { line, point } of found) {
        element("circle", { cx: axes.x.out(point.x), cy: axes.y.out(point.y), r: 3.2, style: `fill:${line.color}` }, this.over);
      }
      this.fillTip(axes, found, event, axes.x.value(axes.x.back(at)));
    }

    fillTip(axes, found, event, x) {
      const head = document.createElement("strong");
      const near = (names, value) => names.reduce((a, b) => (Math.abs(b[0] - value) < Math.abs(a[0] - value) ? b : a))[1];
      const { xnames, ynames } = axes.data;
      head.textContent = xnames ? near(xnames, x) : `${axes.data.xlabel || "x"} ${shown(x)}`;
      const list = document.createElement("dl");
      for (const { line, point } of found) {
        const value = axes.y.value(point.y);
        const term = document.createElement("dt"), definition = document.createElement("dd"), swatch = document.createElement("i");
        swatch.style.background = line.color;
        term.append(swatch, ynames ? near(ynames, value) : line.label);
        definition.append(ynames ? line.label : shown(value));
        list.append(term, definition);
      }
      this.tip.replaceChildren(head, list);
      this.tip.hidden = false;
      const box = this.figure.getBoundingClientRect();
      const left = event.clientX - box.left + 14, room = this.figure.clientWidth - this.tip.offsetWidth - 4;
      this.tip.style.left = `${this.figure.scrollLeft + clamp(left > room ? left - this.tip.offsetWidth - 28 : left, 0, Math.max(room, 0))}px`;
      this.tip.style.top = `${event.clientY - box.top + 14}px`;
    }
  }

  for (const figure of document.querySelectorAll("figure[data-plot]")) plots.push(new Plot(figure));
})();
