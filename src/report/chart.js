// Charts on a canvas: points, lines, bars and intervals; hover, selection, zoom, and the keyboard.

const MARGIN = { left: 62, right: 14, top: 10, bottom: 44 };
/** How far the pointer may be from a point, in px. */
const REACH = 14;
/** Points beyond which they are squares, which draw faster. */
const MANY = 4000;
const HIDDEN = 255;

const cssColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const isDark = () =>
  !document.documentElement.classList.contains("printing") && matchMedia("(prefers-color-scheme: dark)").matches;

const charts = [];

class Chart {
  /** A chart in a figure. It picks a point by calling `pick` of its layer. */
  constructor(figure, title) {
    this.name = figure.id;
    this.caption = make("figcaption");
    this.base = make("canvas", { "aria-hidden": "true" });
    this.over = make("canvas", { tabindex: "0", role: "img" });
    this.plot = make("div", { class: "plot" }, this.base, this.over);
    this.reset = make("button", { type: "button", hidden: true, onclick: () => this.zoom(null) }, "See all");
    this.controls = make("div");
    figure.replaceChildren(this.caption, this.controls, this.plot);
    this.title = title;
    this.view = notes.get(`view ${this.name}`);
    this.current = null;
    this.listen();
    new ResizeObserver(() => this.draw()).observe(this.plot);
    charts.push(this);
  }

  /**
   * Shows layers: `{x: {label, log}, y: {label, log}, layers, key, isSquare}`; `key` has swatches and their words, and a
   * square has the same range on both axes.
   */
  show(content) {
    const axes = JSON.stringify([content.x.label, content.x.log, content.y.label, content.y.log]);
    // A zoom makes sense on the same axes only.
    if (this.view && this.view.axes !== axes) this.view = null;
    this.content = { ...content, axes };
    this.over.setAttribute("aria-label", `${this.title}: ${content.y.label} against ${content.x.label}`);
    const key = (content.key ?? []).map(([colour, words, kind]) => {
      const swatch = make("span", { class: kind ? `swatch ${kind}` : "swatch" });
      swatch.style.background = colour;
      return make("span", {}, swatch, words);
    });
    this.caption.replaceChildren(make("strong", {}, this.title), ...key, this.reset);
    this.draw();
  }

  zoom(view) {
    this.view = view && { ...view, axes: this.content.axes };
    notes.set(`view ${this.name}`, this.view);
    this.hideTip();
    this.draw();
  }

  /** The range of an axis: that of all data, with a little room. */
  range(name) {
    const { [name]: axis, layers } = this.content;
    let [low, high] = [Infinity, -Infinity];
    for (const layer of layers) {
      const lists = {
        points: [layer[name]],
        bars: name === "x" ? [layer.low, layer.high] : [layer.y, [0]],
        intervals: name === "x" ? [layer.x] : [layer.low, layer.high],
      }[layer.type];
      if (!lists || layer.mayLeave) continue;
      for (const list of lists) {
        for (let k = 0; k < list.length; k++) {
          const value = list[k];
          const isShown = !layer.group || layer.group[k] !== HIDDEN;
          if (value === null || !Number.isFinite(value) || !isShown || (axis.log && value <= 0)) continue;
          if (value < low) low = value;
          if (value > high) high = value;
        }
      }
    }
    if (low > high) return null;
    if (axis.log) {
      const room = low === high ? 1.5 : (high / low) ** 0.04;
      return [low / room, high * room];
    }
    const room = low === high ? Math.abs(low) * 0.1 || 1 : (high - low) * 0.04;
    const isBars = layers.some(({ type }) => type === "bars");
    return [isBars && low === 0 ? 0 : low - room, high + room];
  }

  /** Draws with the next frame, however often it is asked to before. */
  draw() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => this.paint());
  }

  paint() {
    this.isDue = false;
    if (!this.content) return;
    const { clientWidth: width, clientHeight: height } = this.plot;
    const scale = Math.max(
      window.devicePixelRatio || 1,
      document.documentElement.classList.contains("printing") ? 2 : 1,
    );
    for (const canvas of [this.base, this.over]) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
      canvas.getContext("2d").scale(scale, scale);
    }
    const ctx = this.base.getContext("2d");
    ctx.font = "12px system-ui, sans-serif";
    this.paintOn(ctx, width, height);
  }

  paintOn(ctx, width, height) {
    const ranges = [this.range("x"), this.range("y")];
    this.reset.hidden = !this.view;
    this.places = [];
    if (ranges.includes(null)) {
      ctx.fillStyle = cssColour("muted");
      ctx.textAlign = "center";
      ctx.fillText(this.content.empty ?? "nothing to show", width / 2, height / 2);
      this.x = null;
      return;
    }
    const [x, y] = this.view ? [this.view.x, this.view.y] : this.content.isSquare ? alike(...ranges) : ranges;
    this.x = new Axis({ ...this.content.x, low: x[0], high: x[1] });
    this.y = new Axis({ ...this.content.y, low: y[0], high: y[1] });
    this.frame = {
      left: MARGIN.left,
      top: MARGIN.top,
      width: width - MARGIN.left - MARGIN.right,
      height: height - MARGIN.top - MARGIN.bottom,
    };
    this.drawAxes(ctx);
    this.named = null;
    ctx.save();
    ctx.beginPath();
    ctx.rect(this.frame.left, this.frame.top, this.frame.width, this.frame.height);
    ctx.clip();
    for (const layer of this.content.layers) this[layer.type](ctx, layer);
    ctx.restore();
  }

  px(value) {
    return this.frame.left + this.x.place(value) * this.frame.width;
  }

  py(value) {
    return this.frame.top + (1 - this.y.place(value)) * this.frame.height;
  }

  drawAxes(ctx) {
    const { left, top, width, height } = this.frame;
    const [ink, grid, line] = ["ink", "grid", "line"].map(cssColour);
    ctx.fillStyle = ink;
    ctx.lineWidth = 1;
    ctx.textAlign = "center";
    ctx.textBaseline = "top";
    for (const [value, label] of this.x.ticks(width / 75)) {
      const at = Math.round(this.px(value)) + 0.5;
      ctx.strokeStyle = label ? grid : line;
      stroke(ctx, [
        [at, label ? top : top + height - 4],
        [at, top + height],
      ]);
      ctx.fillText(label, at, top + height + 6);
    }
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    for (const [value, label] of this.y.ticks(height / 45)) {
      const at = Math.round(this.py(value)) + 0.5;
      ctx.strokeStyle = label ? grid : line;
      stroke(ctx, [
        [left, at],
        [label ? left + width : left + 4, at],
      ]);
      ctx.fillText(label, left - 6, at);
    }
    ctx.strokeStyle = line;
    ctx.strokeRect(left + 0.5, top + 0.5, width - 1, height - 1);
    ctx.textAlign = "center";
    ctx.textBaseline = "bottom";
    ctx.fillText(this.x.label, left + width / 2, top + height + MARGIN.bottom - 4, width);
    ctx.save();
    ctx.translate(4, top + height / 2);
    ctx.rotate(-Math.PI / 2);
    ctx.textBaseline = "top";
    ctx.fillText(this.y.label, 0, 0, height);
    ctx.restore();
  }

  /** `{x, y, group, colours, size, alpha, tip, pick}`; `group` chooses the colour of each point, or hides it. */
  points(ctx, layer) {
    const { x, y, group, colours, size = 2, alpha = 1 } = layer;
    const [at, up] = [new Float32Array(x.length).fill(NaN), new Float32Array(x.length)];
    const edge = size + 2;
    const { left, top, width, height } = this.frame;
    for (let k = 0; k < x.length; k++) {
      if ((group && group[k] === HIDDEN) || x[k] === null || y[k] === null) continue;
      const [right, down] = [this.px(x[k]), this.py(y[k])];
      if (right >= left - edge && right <= left + width + edge && down >= top - edge && down <= top + height + edge) {
        at[k] = right;
        up[k] = down;
      }
    }
    if (x.length > MANY) this.squares(ctx, layer, at, up);
    else {
      ctx.globalAlpha = alpha;
      for (let k = 0; k < x.length; k++) {
        if (Number.isNaN(at[k])) continue;
        ctx.fillStyle = colours[group ? group[k] : 0];
        ctx.beginPath();
        ctx.arc(at[k], up[k], size, 0, 7);
        ctx.fill();
      }
      ctx.globalAlpha = 1;
    }
    if (layer.tip) this.places.push({ layer, at, up });
  }

  /** Points as squares, pixel by pixel: the more of a group on a pixel, the darker; higher groups hide lower ones. */
  squares(ctx, { group, colours, size = 2, alpha = 1 }, at, up) {
    const { width, height } = this.base;
    const scale = width / this.plot.clientWidth;
    const side = Math.max(1, Math.round(size * scale));
    const [top, count] = [new Uint8Array(width * height), new Uint8Array(width * height)];
    for (let k = 0; k < at.length; k++) {
      if (Number.isNaN(at[k])) continue;
      const own = 1 + (group ? group[k] : 0);
      const [left, upper] = [Math.round(at[k] * scale - side / 2), Math.round(up[k] * scale - side / 2)];
      for (let row = Math.max(0, upper); row < Math.min(height, upper + side); row++) {
        for (let pixel = row * width + Math.max(0, left); pixel < row * width + Math.min(width, left + side); pixel++) {
          if (top[pixel] < own) [top[pixel], count[pixel]] = [own, 1];
          else if (top[pixel] === own && count[pixel] < 255) count[pixel]++;
        }
      }
    }
    const image = new ImageData(width, height);
    const shades = colours.map(components);
    for (let pixel = 0; pixel < top.length; pixel++) {
      if (!top[pixel]) continue;
      image.data.set(shades[top[pixel] - 1], 4 * pixel);
      image.data[4 * pixel + 3] = 255 * (1 - (1 - alpha) ** count[pixel]);
    }
    const sheet = make("canvas", { width, height });
    sheet.getContext("2d").putImageData(image, 0, 0);
    ctx.drawImage(sheet, 0, 0, width / scale, height / scale);
  }

  /** `{x, y, colour, dash, width, label}` */
  line(ctx, { x, y, colour, dash = [], width = 1.5, label }) {
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.setLineDash(dash);
    ctx.beginPath();
    let isDown = false;
    for (let k = 0; k < x.length; k++) {
      const [at, up] = [this.px(x[k]), y[k] === null ? NaN : this.py(y[k])];
      if (!Number.isFinite(at) || !Number.isFinite(up)) isDown = false;
      else if (isDown) ctx.lineTo(at, up);
      else {
        ctx.moveTo(at, up);
        isDown = true;
      }
    }
    ctx.stroke();
    ctx.setLineDash([]);
    const up = this.py(y[y.length - 1]);
    // Where lines are close, only some are named.
    if (label && (this.named === null || Math.abs(up - this.named) > 15)) {
      this.named = up;
      ctx.fillStyle = cssColour("muted");
      ctx.textAlign = "right";
      ctx.textBaseline = "bottom";
      ctx.fillText(label, this.frame.left + this.frame.width - 4, up - 1);
    }
  }

  /** `{x, low, high, colour}`: vertical bars of intervals, with caps. */
  intervals(ctx, { x, low, high, group, colour }) {
    ctx.strokeStyle = colour;
    ctx.lineWidth = 1;
    for (let k = 0; k < x.length; k++) {
      if ((group && group[k] === HIDDEN) || [x[k], low[k], high[k]].includes(null)) continue;
      const below = this.y.log && low[k] <= 0 ? this.frame.top + this.frame.height : this.py(low[k]);
      const [at, above] = [this.px(x[k]), this.py(high[k])];
      stroke(ctx, [[at, below], [at, above]]);
      for (const up of [below, above]) stroke(ctx, [[at - 3, up], [at + 3, up]]);
    }
  }

  /** `{low, high, y, colour, tip}` */
  bars(ctx, layer) {
    const { low, high, y, colour } = layer;
    ctx.fillStyle = colour;
    const [at, up] = [new Float32Array(low.length), new Float32Array(low.length)];
    const ground = this.py(this.y.log ? this.y.low : 0);
    for (let k = 0; k < low.length; k++) {
      const [left, right] = [this.px(low[k]), this.px(high[k])];
      const width = Math.max(1, right - left - (right - left > 4 ? 1 : 0));
      at[k] = left + width / 2;
      up[k] = this.py(y[k]);
      ctx.fillRect(left, up[k], width, ground - up[k]);
    }
    if (layer.tip) this.places.push({ layer, at, up, isBars: true });
  }

  /** The point nearest to a place, or `null`. */
  nearest(x, y) {
    let [found, best] = [null, REACH * REACH];
    // What is drawn last lies on top.
    for (const { layer, at, up, isBars } of [...this.places].reverse()) {
      for (let k = 0; k < at.length; k++) {
        const across = at[k] - x;
        const down = isBars && y > up[k] ? 0 : up[k] - y;
        const distance = across * across + down * down;
        if (distance < best) [found, best] = [{ layer, k, x: at[k], y: up[k] }, distance];
      }
    }
    return found;
  }

  point(event) {
    const box = this.over.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  listen() {
    const over = this.over;
    let from = null;
    over.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse" && event.button === 0) from = this.point(event);
    });
    over.addEventListener("pointermove", (event) => {
      const to = this.point(event);
      const isDragged = from && Math.hypot(to[0] - from[0], to[1] - from[1]) > 6;
      if (isDragged) this.drawBox(from, to);
      else if (this.x) this.mark(this.nearest(...to));
    });
    over.addEventListener("pointerup", (event) => {
      const [start, to] = [from, this.point(event)];
      from = null;
      if (!this.x) return;
      const isDragged = start && Math.abs(to[0] - start[0]) > 6 && Math.abs(to[1] - start[1]) > 6;
      if (isDragged) this.zoomTo(start, to);
      else this.pick(this.nearest(...to));
    });
    over.addEventListener("pointerleave", () => {
      from = null;
      this.mark(null);
    });
    over.addEventListener("dblclick", () => this.zoom(null));
    over.addEventListener("blur", () => this.mark(null));
    over.addEventListener("keydown", (event) => this.key(event));
  }

  /** Arrow keys go from point to point, from left to right. */
  key(event) {
    if (event.key === "Escape") this.zoom(null);
    else if (event.key === "Enter") this.pick(this.current);
    else if (event.key === "ArrowRight" || event.key === "ArrowLeft") {
      event.preventDefault();
      const place = this.places.find(({ layer }) => layer.pick) ?? this.places[0];
      if (!place) return;
      const { left, top, width, height } = this.frame;
      const isSeen = (k) =>
        place.at[k] >= left && place.at[k] <= left + width && place.up[k] >= top && place.up[k] <= top + height;
      const order = [...place.at.keys()].filter(isSeen).sort((a, b) => place.at[a] - place.at[b] || a - b);
      const step = event.key === "ArrowRight" ? 1 : -1;
      const now = this.current?.layer === place.layer ? order.indexOf(this.current.k) : step > 0 ? -1 : 0;
      const k = order[(now + step + order.length) % order.length];
      if (k !== undefined) this.mark({ layer: place.layer, k, x: place.at[k], y: place.up[k] });
    }
  }

  zoomTo([x0, y0], [x1, y1]) {
    const { left, top, width, height } = this.frame;
    const across = [x0, x1].map((x) => Math.min(1, Math.max(0, (x - left) / width))).sort((a, b) => a - b);
    const down = [y0, y1].map((y) => Math.min(1, Math.max(0, 1 - (y - top) / height))).sort((a, b) => a - b);
    this.zoom({ x: across.map((place) => this.x.value(place)), y: down.map((place) => this.y.value(place)) });
  }

  clearOver() {
    const ctx = this.over.getContext("2d");
    ctx.clearRect(0, 0, this.plot.clientWidth, this.plot.clientHeight);
    return ctx;
  }

  drawBox([x0, y0], [x1, y1]) {
    this.hideTip();
    const ctx = this.clearOver();
    ctx.strokeStyle = cssColour("accent");
    ctx.strokeRect(x0, y0, x1 - x0, y1 - y0);
  }

  /** Rings a point and says what it is. */
  mark(found) {
    this.current = found;
    const ctx = this.clearOver();
    if (!found) return this.hideTip();
    ctx.strokeStyle = cssColour("mark");
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.arc(found.x, found.y, 6, 0, 7);
    ctx.stroke();
    const tip = element("tip");
    tip.replaceChildren(
      ...found.layer.tip(found.k).map((line) => (typeof line === "string" ? make("p", {}, line) : line)),
    );
    tip.hidden = false;
    const box = this.over.getBoundingClientRect();
    const [x, y] = [box.left + found.x, box.top + found.y];
    const { offsetWidth, offsetHeight } = tip;
    const left = x + 14 + offsetWidth > innerWidth ? x - 14 - offsetWidth : x + 14;
    const top = y + 14 + offsetHeight > innerHeight ? y - 14 - offsetHeight : y + 14;
    tip.style.left = `${Math.max(8, Math.min(left, innerWidth - offsetWidth - 8))}px`;
    tip.style.top = `${Math.max(8, top)}px`;
  }

  hideTip() {
    element("tip").hidden = true;
  }

  pick(found) {
    if (found?.layer.pick) found.layer.pick(found.k);
  }
}

/** Two ranges made the same. */
function alike([low, high], [lower, higher]) {
  const both = [Math.min(low, lower), Math.max(high, higher)];
  return [both, both];
}

/** Red, green and blue of `#rrggbb` or `rgb(r g b)`. */
function components(colour) {
  if (!colour.startsWith("#")) return colour.match(/\d+/g).map(Number);
  return [1, 3, 5].map((place) => Number.parseInt(colour.slice(place, place + 2), 16));
}

function stroke(ctx, corners) {
  ctx.beginPath();
  corners.forEach(([x, y], k) => (k ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
  ctx.stroke();
}
