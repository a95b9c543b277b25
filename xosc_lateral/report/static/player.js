/* The player: a scenario from above, on a canvas. Data: the JSON of `report.player.scene`. No dependencies. */
(() => {
  "use strict";
  const shared = (window.xoscLateral ??= {});
  const players = (shared.players = []);

  /* One clock for the player and for the cursors of all plots over time. */
  const clock = (shared.clock = {
    time: 0,
    end: 0,
    listeners: [],
    set(time) {
      this.time = Math.min(Math.max(time, 0), this.end);
      for (const listener of this.listeners) listener(this.time);
    },
  });

  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  function unpack(column) {
    const text = atob(column.d);
    const bytes = Uint8Array.from(text, (each) => each.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    const values = new Float64Array(bytes.length / column.w + 1);
    let whole = column.b;
    values[0] = whole * column.r;
    for (let i = 1; i < values.length; i++) {
      whole += column.w === 2 ? view.getInt16(2 * (i - 1), true) : view.getInt32(4 * (i - 1), true);
      values[i] = whole * column.r;
    }
    return values;
  }

  /* A line in the world with coordinates along (l) and to the left of it (d). */
  class Track {
    constructor(x, y) {
      Object.assign(this, { x, y, n: x.length });
      this.l = new Float64Array(this.n);
      this.tx = new Float64Array(this.n);
      this.ty = new Float64Array(this.n);
      for (let i = 0; i + 1 < this.n; i++) {
        const dx = x[i + 1] - x[i], dy = y[i + 1] - y[i], length = Math.hypot(dx, dy) || 1e-9;
        this.l[i + 1] = this.l[i] + length;
        for (const k of [i, i + 1]) {
          this.tx[k] += dx / length;
          this.ty[k] += dy / length;
        }
      }
      for (let i = 0; i < this.n; i++) {
        const norm = Math.hypot(this.tx[i], this.ty[i]) || 1;
        this.tx[i] /= norm;
        this.ty[i] /= norm;
      }
    }

    nearest(px, py) {
      let best = 0, smallest = Infinity;
      for (let i = 0; i < this.n; i++) {
        const distance = (px - this.x[i]) ** 2 + (py - this.y[i]) ** 2;
        if (distance < smallest) [best, smallest] = [i, distance];
      }
      return Math.min(best, this.n - 2);
    }

    ahead(px, py, i) {
      return (px - this.x[i]) * this.tx[i] + (py - this.y[i]) * this.ty[i];
    }

    /* [l, d, piece, direction x, direction y]; tangents are interpolated, so that l and d are continuous. */
    project(px, py, hint) {
      let i = hint ?? this.nearest(px, py);
      let steps = this.n;
      while (i < this.n - 2 && steps-- > 0 && this.ahead(px, py, i + 1) > 0) i++;
      while (i > 0 && steps-- > 0 && this.ahead(px, py, i) < 0) i--;
      const dx = this.x[i + 1] - this.x[i], dy = this.y[i + 1] - this.y[i], squared = dx * dx + dy * dy || 1e-12;
      let u = ((px - this.x[i]) * dx + (py - this.y[i]) * dy) / squared;
      let tx = 1, ty = 0;
      for (let round = 0; round < 3; round++) {
        const share = clamp(u, 0, 1);
        tx = this.tx[i] + share * (this.tx[i + 1] - this.tx[i]);
        ty = this.ty[i] + share * (this.ty[i + 1] - this.ty[i]);
        const norm = Math.hypot(tx, ty) || 1;
        tx /= norm;
        ty /= norm;
        u += ((px - this.x[i] - u * dx) * tx + (py - this.y[i] - u * dy) * ty) / (dx * tx + dy * ty || 1e-9);
      }
      const d = tx * (py - this.y[i] - u * dy) - ty * (px - this.x[i] - u * dx);
      return [this.l[i] + u * Math.sqrt(squared), d, i, tx, ty];
    }

    /* World point of (l, d). */
    at(l, d) {
      let i = 0;
      while (i < this.n - 2 && this.l[i + 1] < l) i++;
      const u = (l - this.l[i]) / (this.l[i + 1] - this.l[i] || 1e-9);
      const x = this.x[i] + u * (this.x[i + 1] - this.x[i]), y = this.y[i] + u * (this.y[i + 1] - this.y[i]);
      const share = clamp(u, 0, 1);
      const tx = this.tx[i] + share * (this.tx[i + 1] - this.tx[i]), ty = this.ty[i] + share * (this.ty[i + 1] - this.ty[i]);
      return [x - d * ty, y + d * tx];
    }
  }

  /* A vehicle over time. */
  class Vehicle {
    constructor(data, step) {
      Object.assign(this, data, { step, jumps: new Set(data.jumps) });
      const path = (packed) => packed && Object.fromEntries(Object.entries(packed).map(([k, v]) => [k, unpack(v)]));
      this.nominal = path(data.nominal);
      this.enriched = path(data.enriched);
      this.drawn = this.enriched ?? this.nominal;
      this.offset = unpack(data.offset);
      this.added = data.added && unpack(data.added);
      this.track = new Track(...data.track.map(unpack));
      this.hints = new Map();
    }

    /* Frame and share of the way to the next one; null while the vehicle is absent. */
    frame(time) {
      const exact = time / this.step + 1e-9, i = Math.floor(exact);
      const run = this.present.find(([first, last]) => i >= first && i <= last);
      if (!run) return null;
      return { i, share: i + 1 > run[1] || this.jumps.has(i + 1) ? 0 : exact - i };
    }

    value(values, frame) {
      const here = values[frame.i];
      return frame.share ? here + frame.share * (values[frame.i + 1] - here) : here;
    }

    pose(path, frame) {
      return { x: this.value(path.x, frame), y: this.value(path.y, frame), h: this.value(path.h, frame) };
    }

    corners(pose) {
      const front = this.ahead + this.length / 2, back = this.ahead - this.length / 2;
      const left = this.left + this.width / 2, right = this.left - this.width / 2;
      const cos = Math.cos(pose.h), sin = Math.sin(pose.h);
      const place = ([a, b]) => [pose.x + a * cos - b * sin, pose.y + a * sin + b * cos];
      return [[front, left], [front, right], [back, right], [back, left]].map(place);
    }

    lane(frame) {
      let found = this.lanes[0];
      for (const each of this.lanes) if (each[0] <= frame.i) found = each;
      return found;
    }
  }

  /* Lanes and markings: world points, and on demand points along a track. */
  class Shape {
    constructor(data, closed) {
      Object.assign(this, data, { closed, xs: unpack(data.x), ys: unpack(data.y), views: new Map() });
    }

    /* Path and extent in the world (track null) or along a track; null where the track is far away. */
    seen(track) {
      if (!this.views.has(track)) this.views.set(track, this.build(track));
      return this.views.get(track);
    }

    build(track) {
      const points = [];
      let hint = null;
      const add = (x, y) => {
        if (!track) return points.push([x, y]);
        const [l, d, piece] = track.project(x, y, hint ?? track.nearest(x, y));
        hint = piece;
        if (Math.abs(d) < 80) points.push([l, d]);
      };
      for (let i = 0; i < this.xs.length; i++) {
        const x = this.xs[i], y = this.ys[i];
        if (track && i) {
          const dx = x - this.xs[i - 1], dy = y - this.ys[i - 1], pieces = Math.ceil(Math.hypot(dx, dy) / 5);
          for (let k = 1; k < pieces; k++) add(this.xs[i - 1] + (k / pieces) * dx, this.ys[i - 1] + (k / pieces) * dy);
        }
        add(x, y);
      }
      if (points.length < 2) return null;
      const path = new Path2D();
      points.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
      if (this.closed) path.closePath();
      const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
      return { path, box: [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)] };
    }
  }

  class Player {
    constructor(root) {
      this.root = root;
      const scene = JSON.parse(document.getElementById(root.dataset.scene).textContent);
      this.step = scene.step;
      this.vehicles = scene.entities.map((each) => new Vehicle(each, scene.step));
      this.lanes = scene.lanes.map((each) => new Shape(each, true));
      this.marks = scene.marks.map((each) => new Shape(each, false));
      this.hasGhosts = this.vehicles.some((each) => each.enriched);
      const length = (vehicle) => vehicle.track.l[vehicle.track.n - 1];
      this.longest = this.vehicles.reduce((a, b) => (a && length(a) >= length(b) ? a : b), null);
      this.followed = this.vehicles.find((each) => each.enriched) ?? this.vehicles[0] ?? null;
      this.stretch = 1;
      this.scale = 0;
      this.center = [0, 0];
      this.playing = false;
      this.speed = 1;
      this.showGhosts = true;
      this.boxes = [];
      clock.end = Math.max(clock.end, (scene.frames - 1) * scene.step);
      this.buildControls();
      this.readColors();
      this.listen();
      this.resize();
      clock.listeners.push(() => this.changed());
      this.changed();
    }

    /* ---- what is on the page ---- */
    buildControls() {
      const make = (tag, attributes = {}, ...children) => {
        const element = document.createElement(tag);
        for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
        element.append(...children);
        return element;
      };
      const button = (text, label, action) => {
        const element = make("button", { type: "button", "aria-label": label, title: label }, text);
        element.addEventListener("click", action);
        return element;
      };
      const labelled = (text, ...elements) => make("label", {}, make("span", {}, text), ...elements);
      const select = (options, chosen, action) => {
        const element = make("select");
        for (const [value, text] of options) element.append(make("option", { value }, text));
        element.value = chosen;
        element.addEventListener("change", () => action(element.value));
        return element;
      };
      this.canvas = make("canvas", { tabindex: "0", role: "img", "aria-label": this.root.getAttribute("aria-label") });
      this.tip = make("div", { class: "tip", hidden: "" });
      this.playButton = button("▶", "Play (space)", () => this.toggle());
      this.scrub = make("input", { type: "range", min: 0, max: clock.end, step: "any", value: 0, "aria-label": "Time" });
      this.scrub.addEventListener("input", () => clock.set(Number(this.scrub.value)));
      this.clockFace = make("output", { class: "time" }, "0.0 s");
      const speeds = [["0.25", "¼×"], ["0.5", "½×"], ["1", "1×"], ["2", "2×"], ["4", "4×"]];
      const names = [["", "nobody"], ...this.vehicles.map((each, i) => [String(i), each.name])];
      this.followSelect = select(names, String(this.vehicles.indexOf(this.followed)), (value) =>
        this.follow(value === "" ? null : this.vehicles[Number(value)]));
      this.stretchInput = make("input", { type: "range", min: 1, max: 20, step: 0.5, value: 1, "aria-label": "Lateral stretch" });
      this.stretchInput.addEventListener("input", () => this.setStretch(Number(this.stretchInput.value)));
      this.stretchFace = make("output", {}, "1×");
      const ghosts = make("input", { type: "checkbox" });
      ghosts.checked = true;
      ghosts.addEventListener("change", () => { this.showGhosts = ghosts.checked; this.changed(); });
      this.chips = this.vehicles.map((each) => {
        const swatch = make("i", { style: `background:var(--series-${(each.number % 12) + 1})` });
        const chip = button("", `Follow ${each.name}`, () => this.follow(this.followed === each ? null : each));
        chip.append(swatch, each.name);
        return chip;
      });
      const main = make("div", { class: "controls" },
        this.playButton, this.scrub, this.clockFace,
        labelled("Speed", select(speeds, "1", (value) => (this.speed = Number(value)))));
      const more = make("div", { class: "controls" },
        labelled("Follow", this.followSelect),
        labelled("Lateral stretch", this.stretchInput, this.stretchFace),
        ...(this.hasGhosts ? [labelled("Nominal", ghosts)] : []),
        make("span", { class: "group" },
          button("−", "Zoom out (-)", () => this.zoom(1 / 1.3)),
          button("+", "Zoom in (+)", () => this.zoom(1.3)),
          button("Whole", "Show everything (0)", () => this.showAll())));
      const stage = make("div", { class: "stage" }, this.canvas, this.tip);
      this.root.replaceChildren(stage, main, more, make("div", { class: "chips" }, ...this.chips));
    }

    readColors() {
      const style = getComputedStyle(this.root);
      const read = (name) => style.getPropertyValue(name).trim();
      this.colors = {
        verge: read("--verge"), road: read("--road"), side: read("--roadside"), mark: read("--mark"),
        yellow: read("--mark-yellow"), ink: read("--ink"), paper: read("--paper"), ghost: read("--ghost"),
        font: read("--sans"), series: Array.from({ length: 12 }, (_, i) => read(`--series-${i + 1}`)),
      };
    }

    color(vehicle) {
      return this.colors.series[vehicle.number % 12];
    }

    /* ---- camera ---- */
    get track() {
      return (this.followed ?? this.longest)?.track ?? null;
    }

    get straightened() {
      return this.stretch > 1 && this.track !== null;
    }

    resize() {
      const width = this.canvas.clientWidth || 300, height = this.canvas.clientHeight || 200;
      const ratio = window.devicePixelRatio || 1;
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
      Object.assign(this, { width, height, ratio });
      if (!this.scale) this.scale = width / clamp(width / 8, 55, 110);
      this.changed();
    }

    /* The camera follows the nominal place: what was added then shows as movement on the screen. */
    aim() {
      const frame = this.followed?.frame(clock.time);
      if (frame) {
        const pose = this.followed.pose(this.followed.nominal, frame);
        const ahead = this.followed.ahead;
        this.center = [pose.x + ahead * Math.cos(pose.h), pose.y + ahead * Math.sin(pose.h)];
      }
      const track = this.track;
      if (!track) return (this.camera = { cos: 1, sin: 0, l: 0, d: 0 });
      const [l, d, , tx, ty] = track.project(...this.center);
      if (this.followed) return (this.camera = { cos: tx, sin: ty, l, d });
      const dx = track.x[track.n - 1] - track.x[0], dy = track.y[track.n - 1] - track.y[0], norm = Math.hypot(dx, dy) || 1;
      this.camera = { cos: dx / norm, sin: dy / norm, l, d };
    }

    matrix() {
      const { cos, sin, l, d } = this.camera, s = this.scale;
      const [a, b, c, e] = this.straightened ? [s, 0, 0, -s * this.stretch] : [s * cos, s * sin, s * sin, -s * cos];
      const [x, y] = this.straightened ? [l, d] : this.center;
      return new DOMMatrix([a, b, c, e, this.width / 2 - a * x - c * y, this.height / 2 - b * x - e * y]);
    }

    /* Screen place of a world point; `hint` makes the search along the track short. */
    toScreen(x, y, hint) {
      let point = [x, y];
      if (this.straightened) point = this.track.project(x, y, hint);
      const m = this.view;
      return [m.a * point[0] + m.c * point[1] + m.e, m.b * point[0] + m.d * point[1] + m.f];
    }

    pan(dx, dy) {
      if (this.followed) this.follow(null);
      if (this.straightened) {
        this.center = this.track.at(this.camera.l - dx / this.scale, this.camera.d + dy / (this.scale * this.stretch));
      } else {
        const { cos, sin } = this.camera, along = -dx / this.scale, left = dy / this.scale;
        this.center = [this.center[0] + along * cos - left * sin, this.center[1] + along * sin + left * cos];
      }
      this.changed();
    }

    zoom(factor) {
      this.scale = clamp(this.scale * factor, 0.02, 200);
      this.changed();
    }

    setStretch(value) {
      this.stretch = clamp(value, 1, 20);
      this.stretchInput.value = this.stretch;
      this.stretchFace.textContent = `${this.stretch}×`;
      this.changed();
    }

    follow(vehicle) {
      this.followed = vehicle;
      this.followSelect.value = vehicle ? String(this.vehicles.indexOf(vehicle)) : "";
      this.changed();
    }

    showAll() {
      this.follow(null);
      this.setStretch(1);
      if (!this.longest) return;
      this.aim();
      const { cos, sin } = this.camera;
      let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
      for (const vehicle of this.vehicles) {
        for (const [first, last] of vehicle.present) {
          for (let i = first; i <= last; i += 5) {
            const x = vehicle.nominal.x[i], y = vehicle.nominal.y[i], along = x * cos + y * sin, left = y * cos - x * sin;
            [west, east] = [Math.min(west, along), Math.max(east, along)];
            [south, north] = [Math.min(south, left), Math.max(north, left)];
          }
        }
      }
      const along = (west + east) / 2, left = (south + north) / 2;
      this.center = [along * cos - left * sin, along * sin + left * cos];
      this.scale = clamp(Math.min(this.width / (east - west + 30), this.height / (north - south + 30)), 0.02, 200);
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
      this.aim();
      this.view = this.matrix();
      this.scrub.max = clock.end;
      if (document.activeElement !== this.scrub || this.playing) this.scrub.value = clock.time;
      this.clockFace.textContent = `${clock.time.toFixed(1)} s`;
      this.chips.forEach((chip, i) => chip.setAttribute("aria-pressed", String(this.vehicles[i] === this.followed)));
      const context = this.canvas.getContext("2d");
      context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
      context.fillStyle = this.colors.verge;
      context.fillRect(0, 0, this.width, this.height);
      this.drawRoads(context);
      this.drawVehicles(context);
      this.drawScale(context);
      if (this.pointer) this.showTip();
    }

    inView(box) {
      const m = this.view;
      let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
      for (const x of [box[0], box[2]]) {
        for (const y of [box[1], box[3]]) {
          const sx = m.a * x + m.c * y + m.e, sy = m.b * x + m.d * y + m.f;
          [x0, x1, y0, y1] = [Math.min(x0, sx), Math.max(x1, sx), Math.min(y0, sy), Math.max(y1, sy)];
        }
      }
      return x1 > -20 && x0 < this.width + 20 && y1 > -20 && y0 < this.height + 20;
    }

    drawRoads(context) {
      const track = this.straightened ? this.track : null;
      const place = (shape) => {
        const seen = shape.seen(track);
        if (!seen || !this.inView(seen.box)) return null;
        const path = new Path2D();
        path.addPath(seen.path, this.view);
        return path;
      };
      for (const driving of [false, true]) {
        context.fillStyle = context.strokeStyle = driving ? this.colors.road : this.colors.side;
        context.lineWidth = 1;
        context.setLineDash([]);
        for (const lane of this.lanes) {
          const path = (lane.type === "driving") === driving ? place(lane) : null;
          if (!path) continue;
          context.fill(path);
          context.stroke(path);
        }
      }
      const across = this.scale * (this.straightened ? this.stretch : 1);
      for (const mark of this.marks) {
        const path = place(mark);
        if (!path) continue;
        context.strokeStyle = mark.color === "yellow" ? this.colors.yellow : this.colors.mark;
        context.lineWidth = clamp((mark.width || 0.12) * across, 1, 6);
        const isBroken = mark.type.includes("broken") && this.scale > 0.4;
        context.setLineDash(isBroken ? [6 * this.scale, 12 * this.scale] : []); // German motorways: 6 m line, 12 m gap
        context.lineDashOffset = (mark.start % 18) * this.scale;
        context.stroke(path);
      }
      context.setLineDash([]);
    }

    outline(vehicle, pose) {
      const hint = this.straightened ? this.hintOf(vehicle, pose) : undefined;
      return vehicle.corners(pose).map(([x, y]) => this.toScreen(x, y, hint));
    }

    hintOf(vehicle, pose) {
      const found = this.track.project(pose.x, pose.y, vehicle.hints.get(this.track))[2];
      vehicle.hints.set(this.track, found);
      return found;
    }

    drawVehicles(context) {
      this.boxes = [];
      for (const vehicle of this.vehicles) {
        const frame = vehicle.frame(clock.time);
        if (!frame) continue;
        const outline = this.outline(vehicle, vehicle.pose(vehicle.drawn, frame));
        const box = { vehicle, frame, outline, ghost: null };
        if (vehicle.enriched && this.showGhosts) box.ghost = this.outline(vehicle, vehicle.pose(vehicle.nominal, frame));
        this.boxes.push(box);
      }
      const trace = (points) => {
        context.beginPath();
        points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
        context.closePath();
      };
      for (const { vehicle, outline, ghost } of this.boxes) {
        const size = Math.hypot(outline[0][0] - outline[3][0], outline[0][1] - outline[3][1]);
        trace(outline);
        context.fillStyle = this.color(vehicle);
        context.fill();
        context.lineWidth = vehicle === this.followed ? 2.5 : 1.2;
        context.strokeStyle = this.colors.paper;
        context.stroke();
        if (size > 14) this.drawWindscreen(context, outline);
        if (size < 6) {
          const [x, y] = middle(outline);
          context.beginPath();
          context.arc(x, y, 3.5, 0, 7);
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
      this.drawNames(context);
    }

    drawWindscreen(context, [frontLeft, frontRight, backRight, backLeft]) {
      const between = (a, b, share) => [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
      const points = [
        between(frontLeft, backLeft, 0.22), between(frontRight, backRight, 0.22),
        between(frontRight, backRight, 0.36), between(frontLeft, backLeft, 0.36),
      ];
      context.beginPath();
      points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      context.fillStyle = "rgba(10, 20, 30, .5)";
      context.fill();
    }

    drawNames(context) {
      context.font = `600 12px ${this.colors.font}`;
      context.textAlign = "center";
      context.textBaseline = "bottom";
      context.lineWidth = 3.5;
      context.lineJoin = "round";
      const taken = [];
      for (const { vehicle, outline } of this.boxes) {
        const [x] = middle(outline), width = context.measureText(vehicle.name).width / 2 + 2;
        let y = Math.min(...outline.map((p) => p[1])) - 4;
        while (taken.some(([left, right, base]) => x + width > left && x - width < right && Math.abs(base - y) < 14)) y -= 14;
        taken.push([x - width, x + width, y]);
        context.strokeStyle = this.colors.paper;
        context.strokeText(vehicle.name, x, y);
        context.fillStyle = this.colors.ink;
        context.fillText(vehicle.name, x, y);
      }
    }

    drawScale(context) {
      const steps = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
      const length = steps.filter((each) => each * this.scale < this.width / 3).pop() ?? steps[0];
      const text = `${length} m` + (this.straightened ? ` along, ${Number((length / this.stretch).toPrecision(2))} m across` : "");
      const x = 12, y = this.height - 12;
      context.font = `12px ${this.colors.font}`;
      context.textAlign = "left";
      context.textBaseline = "bottom";
      for (const [color, width] of [[this.colors.paper, 4], [this.colors.ink, 1.5]]) {
        context.strokeStyle = color;
        context.lineWidth = width;
        context.beginPath();
        context.moveTo(x, y - 5);
        context.lineTo(x, y);
        context.lineTo(x + length * this.scale, y);
        context.lineTo(x + length * this.scale, y - 5);
        context.stroke();
      }
      context.lineWidth = 3.5;
      context.strokeStyle = this.colors.paper;
      context.strokeText(text, x, y - 7);
      context.fillStyle = this.colors.ink;
      context.fillText(text, x, y - 7);
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
      const place = (event) => {
        const box = this.canvas.getBoundingClientRect();
        return [event.clientX - box.left, event.clientY - box.top];
      };
      const fingers = new Map();
      let moved = 0;
      const canvas = this.canvas;
      canvas.addEventListener("pointerdown", (event) => {
        fingers.set(event.pointerId, place(event));
        moved = 0;
        canvas.setPointerCapture(event.pointerId);
      });
      canvas.addEventListener("pointermove", (event) => {
        const now = place(event), before = fingers.get(event.pointerId);
        this.pointer = now;
        if (!before) return this.showTip();
        const dx = now[0] - before[0], dy = now[1] - before[1];
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
        const wasTap = fingers.delete(event.pointerId) && moved <= 4 && event.type === "pointerup";
        if (!wasTap) return;
        this.pointer = place(event);
        const hit = this.hit(...this.pointer);
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
      const restyled = () => { this.readColors(); this.changed(); };
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyled);
      document.addEventListener("visibilitychange", () => document.hidden && this.toggle(false));
    }

    key(event) {
      const onControl = event.target !== this.canvas && /^(INPUT|SELECT|BUTTON)$/.test(event.target.tagName);
      if (onControl || event.ctrlKey || event.metaKey || event.altKey) return;
      const step = event.shiftKey ? 1 : 0.1;
      const next = () => {
        const i = this.vehicles.indexOf(this.followed);
        this.follow(this.vehicles[i + 1] ?? null);
      };
      const actions = {
        " ": () => this.toggle(),
        ArrowLeft: () => clock.set(clock.time - step), ArrowRight: () => clock.set(clock.time + step),
        ArrowUp: () => this.setStretch(this.stretch + 1), ArrowDown: () => this.setStretch(this.stretch - 1),
        Home: () => clock.set(0), End: () => clock.set(clock.end),
        "+": () => this.zoom(1.3), "=": () => this.zoom(1.3), "-": () => this.zoom(1 / 1.3),
        0: () => this.showAll(), f: next, F: next,
      };
      const action = actions[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    }

    hit(x, y) {
      let best = null, nearest = 14;
      for (const box of this.boxes) {
        const [cx, cy] = middle(box.outline), distance = contains(box.outline, x, y) ? 0 : Math.hypot(x - cx, y - cy);
        if (distance < nearest) [best, nearest] = [box, distance];
      }
      return best;
    }

    showTip() {
      const hit = this.pointer && this.hit(...this.pointer);
      this.tip.hidden = !hit;
      if (!hit) return;
      const { vehicle, frame } = hit;
      const speed = vehicle.value(vehicle.drawn.v, frame), added = vehicle.added ? vehicle.value(vehicle.added, frame) : 0;
      const [, road, lane] = vehicle.lane(frame);
      const sided = (value) => `${Math.abs(value).toFixed(2)} m ${Math.abs(value) < 0.005 ? "" : value > 0 ? "left" : "right"}`;
      const rows = [
        ["speed", `${speed.toFixed(1)} m/s (${(3.6 * speed).toFixed(0)} km/h)`],
        ...(vehicle.added ? [["from nominal", sided(added)]] : []),
        ...(road ? [["nominal offset", sided(vehicle.value(vehicle.offset, frame))], ["lane", `${lane} of road ${road}`]] : []),
        ["lateral acceleration", `${vehicle.value(vehicle.drawn.a, frame).toFixed(2)} m/s²`],
      ];
      const name = document.createElement("strong");
      name.textContent = vehicle.name;
      const list = document.createElement("dl");
      for (const row of rows) {
        ["dt", "dd"].forEach((tag, i) => list.appendChild(document.createElement(tag)).append(row[i]));
      }
      this.tip.replaceChildren(name, list);
      const [x, y] = this.pointer;
      this.tip.style.left = `${clamp(x + 14, 0, Math.max(0, this.width - this.tip.offsetWidth - 4))}px`;
      this.tip.style.top = `${y > this.height / 2 ? y - this.tip.offsetHeight - 12 : y + 16}px`;
    }
  }

  const middle = (points) => [0, 1].map((k) => points.reduce((sum, point) => sum + point[k], 0) / points.length);

  function contains(points, x, y) {
    let inside = false;
    points.forEach(([ax, ay], i) => {
      const [bx, by] = points[(i + 1) % points.length];
      if (ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax)) inside = !inside;
    });
    return inside;
  }

  for (const root of document.querySelectorAll(".player")) players.push(new Player(root));
})();
