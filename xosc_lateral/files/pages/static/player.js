/* The player: a scenario from above, on a canvas. Data: the JSON of `scene_of`. No dependencies. */
(() => {
  "use strict";
  const shared = (window.xoscLateral ??= {});
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  /* One clock for the player and for the cursors of all figures over time. */
  const clock = (shared.clock = {
    time: 0,
    end: 0,
    listeners: [],
    set(time) {
      this.time = clamp(time, 0, this.end);
      for (const listener of this.listeners) listener();
    },
  });

  /* Columns hold differences between successive values, in units of their resolution. */
  function unpack({ r, d }) {
    let whole = 0;
    return Float64Array.from(d, (step) => (whole += step) * r);
  }

  function make(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  }

  class Vehicle {
    constructor(data, step) {
      Object.assign(this, data, { step, jumps: new Set(data.jumps) });
      const path = (packed) => packed && Object.fromEntries(Object.entries(packed).map(([k, v]) => [k, unpack(v)]));
      this.nominal = path(data.nominal);
      this.enriched = path(data.enriched);
      this.drawn = this.enriched ?? this.nominal;
      this.course = unpack(data.course);
      this.offset = unpack(data.offset);
      this.added = data.added && unpack(data.added);
    }

    /* Frame and share of the way to the next one; null while the vehicle is absent. */
    frame(time) {
      const exact = time / this.step + 1e-9, i = Math.floor(exact);
      const run = this.present.find(([first, last]) => i >= first && i <= last);
      return run ? { i, share: i + 1 > run[1] || this.jumps.has(i + 1) ? 0 : exact - i } : null;
    }

    value(values, { i, share }) {
      return share ? values[i] + share * (values[i + 1] - values[i]) : values[i];
    }

    /* World point `a` ahead of the reference point and `b` to its left. */
    point(path, frame, a, b) {
      const heading = this.value(path.h, frame), cos = Math.cos(heading), sin = Math.sin(heading);
      return [this.value(path.x, frame) + a * cos - b * sin, this.value(path.y, frame) + a * sin + b * cos];
    }

    corners(path, frame) {
      const [front, back] = [this.ahead + this.length / 2, this.ahead - this.length / 2];
      const [left, right] = [this.left + this.width / 2, this.left - this.width / 2];
      return [[front, left], [front, right], [back, right], [back, left]].map(([a, b]) => this.point(path, frame, a, b));
    }
  }

  /* A lane or a marking: its path and its extent in the world. */
  function shape(data, closed) {
    const xs = unpack(data.x), ys = unpack(data.y), path = new Path2D();
    xs.forEach((x, i) => (i ? path.lineTo(x, ys[i]) : path.moveTo(x, ys[i])));
    if (closed) path.closePath();
    return { ...data, path, box: [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)] };
  }

  class Player {
    constructor(root) {
      const scene = JSON.parse(root.nextElementSibling.textContent);
      this.root = root;
      this.vehicles = scene.entities.map((each) => new Vehicle(each, scene.step));
      this.lanes = scene.lanes.map((each) => shape(each, true));
      this.marks = scene.marks.map((each) => shape(each, false));
      this.followed = this.vehicles.find((each) => each.enriched) ?? this.vehicles[0] ?? null;
      Object.assign(this, { stretch: 1, scale: 0, center: [0, 0], course: 0, playing: false, speed: 1, showGhosts: true, boxes: [] });
      [this.across, this.start, this.titles] = [scene.across, scene.start, scene.views]; // its clock may be a recording's
      this.sideBySide = this.vehicles.some((each) => each.enriched);
      clock.end = Math.max(clock.end, (scene.frames - 1) * scene.step);
      this.build();
      this.readColors();
      this.listen();
      this.resize();
      clock.listeners.push(() => this.changed());
    }

    /* ---- what is on the page ---- */
    build() {
      const button = (text, label, action) => {
        const element = make("button", { type: "button", "aria-label": label, title: label }, text);
        element.addEventListener("click", action);
        return element;
      };
      const on = (element, kind, action) => (element.addEventListener(kind, () => action(element)), element);
      const labelled = (text, ...elements) => make("label", {}, make("span", {}, text), ...elements);
      this.canvas = make("canvas", { tabindex: "0", role: "img", "aria-label": this.root.getAttribute("aria-label") });
      this.tip = make("div", { class: "tip", hidden: "" });
      this.playButton = button("▶", "Play (space)", () => this.toggle());
      this.scrub = on(make("input", { type: "range", min: 0, max: clock.end, step: "any", value: 0, "aria-label": "Time" }),
        "input", (bar) => clock.set(Number(bar.value)));
      this.clockFace = make("output", { class: "time" }, `${this.start.toFixed(1)} s`);
      const speeds = [["0.25", "¼×"], ["0.5", "½×"], ["1", "1×"], ["2", "2×"], ["4", "4×"]];
      const speed = make("select", {}, ...speeds.map(([value, text]) => make("option", { value }, text)));
      speed.value = "1";
      on(speed, "change", () => (this.speed = Number(speed.value)));
      this.pace = (way) => {
        speed.selectedIndex = clamp(speed.selectedIndex + way, 0, speeds.length - 1);
        this.speed = Number(speed.value);
      };
      this.stretchBar = on(make("input", { type: "range", min: 1, max: 20, step: 0.5, value: 1, "aria-label": "Lateral stretch" }),
        "input", (bar) => this.setStretch(Number(bar.value)));
      this.stretchFace = make("output", {}, "1×");
      const ghosts = on(make("input", { type: "checkbox", checked: "" }), "change", (box) => {
        this.showGhosts = box.checked;
        this.changed();
      });
      const pair = on(make("input", { type: "checkbox", checked: "" }), "change", (box) => {
        this.sideBySide = box.checked;
        this.setStretch(this.fittingStretch());
      });
      const compared = this.sideBySide ? [labelled("Side by side", pair), labelled("Outlines as written", ghosts)] : [];
      this.chips = this.vehicles.map((each) => {
        const chip = button("", `Follow ${each.name}`, () => this.follow(this.followed === each ? null : each));
        chip.append(make("i", { style: `background:var(--series-${(each.number % 12) + 1})` }), each.name);
        return chip;
      });
      this.root.replaceChildren(
        make("div", { class: "stage" }, this.canvas, this.tip),
        make("div", { class: "controls" }, this.playButton, this.scrub, this.clockFace, labelled("Speed", speed)),
        make("div", { class: "controls" },
          labelled("Lateral stretch", this.stretchBar, this.stretchFace), ...compared,
          make("span", { class: "group" }, button("−", "Zoom out (-)", () => this.zoom(1 / 1.3)),
            button("+", "Zoom in (+)", () => this.zoom(1.3)), button("1:1", "True proportions (1)", () => this.setStretch(1)), button("Whole", "Show everything (0)", () => this.showAll()))),
        make("div", { class: "chips" }, ...this.chips));
    }

    readColors() {
      const style = getComputedStyle(this.root), read = (name) => style.getPropertyValue(name).trim();
      const names = ["verge", "road", "roadside", "mark", "mark-yellow", "ink", "paper", "ghost", "sans"];
      this.colors = Object.fromEntries(names.map((name) => [name, read(`--${name}`)]));
      this.series = Array.from({ length: 12 }, (_, i) => read(`--series-${i + 1}`));
    }

    /* ---- camera: it follows the nominal place, so that what was added shows as movement, and looks along the lane ---- */
    resize() {
      this.ratio = window.devicePixelRatio || 1;
      [this.width, this.height] = [this.canvas.clientWidth || 300, this.canvas.clientHeight || 200];
      [this.canvas.width, this.canvas.height] = [this.width, this.height].map((side) => Math.round(side * this.ratio));
      if (!this.scale) {
        this.scale = this.width / clamp(this.width / 8, 55, 110);
        this.setStretch(this.fittingStretch());
      }
      this.changed();
    }

    get views() {
      return this.sideBySide ? 2 : 1;
    }

    /* So wide that the driving lanes fill the view: what was added is seen, and little grass. */
    fittingStretch() {
      const room = (0.92 * this.height) / this.views / 2;
      return clamp(Math.round((2 * room) / (this.scale * this.across)) / 2, 1, 8);
    }

    aim() {
      const frame = this.followed?.frame(clock.time);
      if (frame) {
        this.center = this.followed.point(this.followed.nominal, frame, this.followed.ahead, 0);
        this.course = this.followed.value(this.followed.course, frame);
      }
      const cos = Math.cos(this.course), sin = Math.sin(this.course), along = this.scale, across = this.scale * this.stretch;
      const [a, b, c, d] = [along * cos, across * sin, along * sin, -across * cos], [x, y] = this.center;
      this.view = new DOMMatrix([a, b, c, d, this.width / 2 - a * x - c * y, this.middle - b * x - d * y]);
    }

    toScreen([x, y]) {
      const m = this.view;
      return [m.a * x + m.c * y + m.e, m.b * x + m.d * y + m.f];
    }

    pan(dx, dy) {
      if (this.followed) this.follow(null);
      const place = this.view.inverse().transformPoint(new DOMPoint(this.width / 2 - dx, this.middle - dy));
      this.center = [place.x, place.y];
      this.changed();
    }

    zoom(factor) {
      this.scale = clamp(this.scale * factor, 0.02, 200);
      this.changed();
    }

    setStretch(value) {
      this.stretch = clamp(value, 1, 20);
      this.stretchBar.value = this.stretch;
      this.stretchFace.textContent = `${this.stretch}×`;
      this.changed();
    }

    follow(vehicle) {
      this.followed = vehicle;
      this.changed();
    }

    showAll() {
      this.follow(null);
      this.setStretch(1);
      const places = this.vehicles.flatMap(({ nominal, present }) =>
        present.flatMap(([first, last]) => [...Array(last - first + 1).keys()].map((k) => [nominal.x[first + k], nominal.y[first + k]])));
      if (!places.length) return;
      const [first, last] = [places[0], places[places.length - 1]];
      this.course = Math.atan2(last[1] - first[1], last[0] - first[0]);
      const cos = Math.cos(this.course), sin = Math.sin(this.course);
      const range = (values) => values.reduce(([low, high], each) => [Math.min(low, each), Math.max(high, each)], [Infinity, -Infinity]);
      const along = range(places.map(([x, y]) => x * cos + y * sin)), left = range(places.map(([x, y]) => y * cos - x * sin));
      const [a, b] = [(along[0] + along[1]) / 2, (left[0] + left[1]) / 2];
      this.center = [a * cos - b * sin, a * sin + b * cos];
      this.scale = clamp(Math.min(this.width / (along[1] - along[0] + 30), this.height / this.views / (left[1] - left[0] + 30)), 0.02, 200);
      this.changed();
    }

    /* ---- drawing ---- */
    changed() {
      if (this.asked) return;
      this.asked = true;
      requestAnimationFrame(() => { this.asked = false; this.draw(); });
    }

    draw() {
      if ((window.devicePixelRatio || 1) !== this.ratio) return this.resize(); // the window moved to another screen
      if (document.activeElement !== this.scrub || this.playing) this.scrub.value = clock.time;
      this.clockFace.textContent = `${(this.start + clock.time).toFixed(1)} s`;
      this.chips.forEach((chip, i) => chip.setAttribute("aria-pressed", String(this.vehicles[i] === this.followed)));
      const context = this.canvas.getContext("2d");
      context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
      context.fillStyle = this.colors.verge;
      context.fillRect(0, 0, this.width, this.height);
      this.boxes = [];
      const high = this.height / this.views;
      const views = this.sideBySide ? [[this.titles[0], "nominal"], [this.titles[1], "drawn"]] : [["", "drawn"]];
      views.forEach(([title, path], k) => {
        this.middle = (k + 0.5) * high;
        this.aim();
        context.save();
        context.beginPath();
        context.rect(0, k * high, this.width, high);
        context.clip();
        this.drawRoads(context);
        const boxes = this.drawVehicles(context, path);
        this.drawNames(context, boxes);
        this.boxes.push(...boxes);
        if (title) this.writeTitle(context, title, k * high);
        context.restore();
      });
      this.drawScale(context);
      if (this.pointer) this.showTip();
    }

    /* A lane's or a marking's path on the screen; null where it is out of sight. */
    seen({ path, box }) {
      const corners = [[0, 1], [0, 3], [2, 1], [2, 3]].map(([i, k]) => this.toScreen([box[i], box[k]]));
      const [xs, ys] = [0, 1].map((k) => corners.map((corner) => corner[k]));
      if (Math.max(...xs) < 0 || Math.min(...xs) > this.width || Math.max(...ys) < 0 || Math.min(...ys) > this.height) return null;
      const onScreen = new Path2D();
      onScreen.addPath(path, this.view);
      return onScreen;
    }

    drawRoads(context) {
      context.lineWidth = 1;
      for (const driving of [false, true]) {
        context.fillStyle = context.strokeStyle = this.colors[driving ? "road" : "roadside"];
        for (const lane of this.lanes) {
          const path = (lane.type === "driving") === driving && this.seen(lane);
          if (path) [context.fill(path), context.stroke(path)];
        }
      }
      for (const mark of this.marks) {
        const path = this.seen(mark);
        if (!path) continue;
        context.strokeStyle = this.colors[mark.color === "yellow" ? "mark-yellow" : "mark"];
        context.lineWidth = clamp((mark.width || 0.12) * this.scale * this.stretch, 1, 6);
        const isBroken = mark.type.includes("broken") && this.scale > 0.4;
        context.setLineDash(isBroken ? [6 * this.scale, 12 * this.scale] : []); // German motorways: 6 m line, 12 m gap
        context.lineDashOffset = (mark.start % 18) * this.scale;
        context.stroke(path);
      }
      context.setLineDash([]);
    }

    drawVehicles(context, drawn) {
      const boxes = [];
      const trace = (points) => {
        context.beginPath();
        points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
        context.closePath();
      };
      for (const vehicle of this.vehicles) {
        const frame = vehicle.frame(clock.time);
        if (!frame) continue;
        const onScreen = (path) => vehicle.corners(path, frame).map((point) => this.toScreen(point));
        const isGhosted = vehicle.enriched && this.showGhosts && drawn === "drawn";
        const outline = onScreen(vehicle[drawn]), ghost = isGhosted ? onScreen(vehicle.nominal) : null;
        boxes.push({ vehicle, frame, outline, top: Math.min(...[...outline, ...(ghost ?? [])].map(([, y]) => y)) });
        trace(outline);
        context.fillStyle = this.series[vehicle.number % 12];
        context.strokeStyle = this.colors.paper;
        context.lineWidth = vehicle === this.followed ? 2.5 : 1.2;
        [context.fill(), context.stroke()];
        const [frontLeft, frontRight, backRight, backLeft] = outline, [x, y] = middle(outline);
        if (Math.hypot(x - frontLeft[0], y - frontLeft[1]) < 4) {
          context.beginPath();
          context.arc(x, y, 3.5, 0, 7);
          context.fill();
        } else {
          const between = (a, b, share) => [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
          const sides = [[frontLeft, backLeft], [frontRight, backRight]];
          trace([...sides.map((side) => between(...side, 0.22)), ...sides.reverse().map((side) => between(...side, 0.36))]);
          context.fillStyle = "rgba(10, 20, 30, .5)"; // the windscreen
          context.fill();
        }
        if (ghost) {
          trace(ghost);
          context.lineWidth = 1.2;
          context.strokeStyle = this.colors.ghost;
          context.setLineDash([4, 3]);
          context.stroke();
          context.setLineDash([]);
        }
      }
      return boxes;
    }

    writeTitle(context, text, top) {
      context.font = `600 13px ${this.colors.sans}`;
      context.textAlign = "left";
      this.write(context, text, 12, top + 22);
      context.fillStyle = this.colors.paper;
      if (top > 0) context.fillRect(0, top - 1, this.width, 2);
    }

    write(context, text, x, y) {
      context.textBaseline = "bottom";
      context.lineWidth = 3.5;
      context.lineJoin = "round";
      context.strokeStyle = this.colors.paper;
      context.strokeText(text, x, y);
      context.fillStyle = this.colors.ink;
      context.fillText(text, x, y);
    }

    drawNames(context, boxes) {
      context.font = `600 12px ${this.colors.sans}`;
      context.textAlign = "center";
      const taken = [];
      for (const { vehicle, outline, top } of boxes) {
        const [x] = middle(outline), width = context.measureText(vehicle.name).width / 2 + 2;
        let y = top - 4;
        while (taken.some(([left, right, base]) => x + width > left && x - width < right && Math.abs(base - y) < 14)) y -= 14;
        taken.push([x - width, x + width, y]);
        this.write(context, vehicle.name, x, y);
      }
    }

    drawScale(context) {
      const steps = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000], x = 12, y = this.height - 12;
      const length = steps.filter((each) => each * this.scale < this.width / 3).pop() ?? steps[0];
      const across = this.stretch > 1 ? ` along, ${Number((length / this.stretch).toPrecision(2))} m across` : "";
      for (const [color, width] of [[this.colors.paper, 4], [this.colors.ink, 1.5]]) {
        Object.assign(context, { strokeStyle: color, lineWidth: width });
        context.stroke(new Path2D(`M ${x} ${y - 5} v 5 h ${length * this.scale} v -5`));
      }
      context.font = `12px ${this.colors.sans}`;
      context.textAlign = "left";
      this.write(context, `${length} m${across}`, x, y - 7);
    }

    /* ---- being used ---- */
    toggle(wanted = !this.playing) {
      if (wanted === this.playing) return;
      this.playing = wanted;
      this.playButton.textContent = wanted ? "❚❚" : "▶";
      if (!wanted) return;
      if (clock.time >= clock.end - 1e-6) clock.set(0);
      let before = null;
      const tick = (now) => {
        if (!this.playing) return;
        if (before !== null) clock.set(clock.time + (this.speed * Math.min(now - before, 250)) / 1000);
        before = now;
        if (clock.time >= clock.end) return this.toggle(false);
        requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }

    listen() {
      const { canvas } = this, fingers = new Map();
      let moved = 0;
      const place = (event) => {
        const box = canvas.getBoundingClientRect();
        return [event.clientX - box.left, event.clientY - box.top];
      };
      canvas.addEventListener("pointerdown", (event) => {
        fingers.set(event.pointerId, place(event));
        moved = 0;
        canvas.setPointerCapture(event.pointerId);
      });
      canvas.addEventListener("pointermove", (event) => {
        const now = (this.pointer = place(event)), before = fingers.get(event.pointerId);
        if (!before) return this.showTip();
        const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
        moved += Math.hypot(dx, dy);
        if (fingers.size === 2) {
          const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
          const spread = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]) || 1;
          this.zoom(spread(now) / spread(before));
        } else if (moved > 4) {
          this.pan(dx, dy);
        }
        fingers.set(event.pointerId, now);
      });
      const release = (event) => {
        if (!fingers.delete(event.pointerId) || moved > 4 || event.type !== "pointerup") return;
        this.pointer = place(event);
        const hit = this.hit();
        if (hit) this.follow(hit.vehicle);
        this.showTip();
      };
      canvas.addEventListener("pointerup", release);
      canvas.addEventListener("pointercancel", release);
      canvas.addEventListener("pointerleave", () => { this.pointer = null; this.tip.hidden = true; });
      canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.metaKey && document.activeElement !== canvas) return; // else the page scrolls
        event.preventDefault();
        this.zoom(Math.exp(-event.deltaY * 0.0015));
      }, { passive: false });
      this.root.addEventListener("keydown", (event) => this.key(event));
      new ResizeObserver(() => this.resize()).observe(canvas);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { this.readColors(); this.changed(); });
      document.addEventListener("visibilitychange", () => document.hidden && this.toggle(false));
    }

    key(event) {
      const onControl = event.target !== this.canvas && /^(INPUT|SELECT|BUTTON)$/.test(event.target.tagName);
      if (onControl || event.ctrlKey || event.metaKey || event.altKey) return;
      const step = event.shiftKey ? 1 : 0.1;
      const next = () => this.follow(this.vehicles[this.vehicles.indexOf(this.followed) + 1] ?? null);
      const action = {
        " ": () => this.toggle(),
        ArrowLeft: () => clock.set(clock.time - step), ArrowRight: () => clock.set(clock.time + step),
        ArrowUp: () => this.setStretch(this.stretch + 1), ArrowDown: () => this.setStretch(this.stretch - 1),
        Home: () => clock.set(0), End: () => clock.set(clock.end),
        "+": () => this.zoom(1.3), "=": () => this.zoom(1.3), "-": () => this.zoom(1 / 1.3),
        0: () => this.showAll(), 1: () => this.setStretch(1), f: next, F: next,
        "<": () => this.pace(-1), ",": () => this.pace(-1), ">": () => this.pace(1), ".": () => this.pace(1),
      }[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    }

    /* The box below the pointer, or near it. */
    hit() {
      const context = this.canvas.getContext("2d"), [x, y] = this.pointer;
      const off = ({ outline }) => {
        const path = new Path2D(`M ${outline.map((point) => point.join(" ")).join(" L ")} Z`);
        const [cx, cy] = middle(outline);
        return context.isPointInPath(path, x * this.ratio, y * this.ratio) ? 0 : Math.hypot(x - cx, y - cy);
      };
      return this.boxes.map((box) => [off(box), box]).filter(([distance]) => distance < 14).sort((a, b) => a[0] - b[0])[0]?.[1];
    }

    showTip() {
      const found = this.pointer && this.hit();
      this.tip.hidden = !found;
      if (!found) return;
      const { vehicle, frame } = found, speed = vehicle.value(vehicle.drawn.v, frame);
      const [, road, lane] = vehicle.lanes.filter(([first]) => first <= frame.i).pop() ?? vehicle.lanes[0];
      const sided = (value) => `${Math.abs(value).toFixed(2)} m ${Math.abs(value) < 0.005 ? "" : value > 0 ? "left" : "right"}`;
      const rows = [
        ["speed", `${speed.toFixed(1)} m/s (${(3.6 * speed).toFixed(0)} km/h)`],
        ...(vehicle.added ? [["from nominal", sided(vehicle.value(vehicle.added, frame))]] : []),
        ...(road ? [["nominal offset", sided(vehicle.value(vehicle.offset, frame))], ["lane", `${lane} of road ${road}`]] : []),
      ];
      const list = make("dl", {}, ...rows.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
      this.tip.replaceChildren(make("strong", {}, vehicle.name), list);
      const [x, y] = this.pointer;
      this.tip.style.left = `${clamp(x + 14, 0, Math.max(0, this.width - this.tip.offsetWidth - 4))}px`;
      this.tip.style.top = `${y > this.height / 2 ? y - this.tip.offsetHeight - 12 : y + 16}px`;
    }
  }

  const middle = (points) => [0, 1].map((k) => points.reduce((sum, point) => sum + point[k], 0) / points.length);
  shared.players = [...document.querySelectorAll(".player")].map((root) => new Player(root));
})();
