// What charts draw with on a canvas, as SVG.

class SvgContext {
  constructor(width, height, background) {
    this.parts = [];
    this.size = [width, height];
    Object.assign(this, { fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, globalAlpha: 1, dash: [], place: "" });
    this.stack = [];
    this.clips = 0;
    this.clipped = "";
    this.fillStyle = background;
    this.fillRect(0, 0, width, height);
  }

  text() {
    const [width, height] = this.size;
    const head = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"`;
    return `${head} font-family="system-ui, sans-serif" font-size="12">${this.parts.join("")}</svg>\n`;
  }

  /** An element with what holds for all: opacity, clip, place. */
  add(name, attributes, content = "") {
    const common = { opacity: this.globalAlpha === 1 ? "" : this.globalAlpha, transform: this.place, "clip-path": this.clipped };
    const all = Object.entries({ ...attributes, ...common }).filter(([, value]) => value !== "");
    const shown = all.map(([key, value]) => ` ${key}="${typeof value === "number" ? +value.toFixed(2) : escaped(value)}"`);
    this.parts.push(`<${name}${shown.join("")}>${content}</${name}>`);
  }

  save() {
    const { place, clipped } = this;
    this.stack.push({ place, clipped });
  }

  restore() {
    Object.assign(this, this.stack.pop());
  }

  translate(x, y) {
    this.place += `translate(${x} ${y})`;
  }

  rotate(angle) {
    this.place += `rotate(${(angle * 180) / Math.PI})`;
  }

  beginPath() {
    this.path = "";
  }

  moveTo(x, y) {
    this.path += `M${x.toFixed(2)} ${y.toFixed(2)}`;
  }

  lineTo(x, y) {
    this.path += `L${x.toFixed(2)} ${y.toFixed(2)}`;
  }

  rect(x, y, width, height) {
    this.path += `M${x} ${y}h${width}v${height}h${-width}z`;
  }

  /** A whole circle. */
  arc(x, y, radius) {
    const [left, across] = [x - radius, 2 * radius];
    this.path += `M${left.toFixed(2)} ${y.toFixed(2)}a${radius} ${radius} 0 1 0 ${across} 0a${radius} ${radius} 0 1 0 ${-across} 0`;
  }

  clip() {
    this.clips++;
    this.parts.push(`<clipPath id="clip-${this.clips}"><path d="${this.path}"/></clipPath>`);
    this.clipped = `url(#clip-${this.clips})`;
  }

  fill() {
    this.add("path", { d: this.path, fill: this.fillStyle });
  }

  stroke() {
    const { strokeStyle: stroke, lineWidth } = this;
    this.add("path", { d: this.path, fill: "none", stroke, "stroke-width": lineWidth, "stroke-dasharray": this.dash.join(" ") });
  }

  setLineDash(dash) {
    this.dash = dash;
  }

  fillRect(x, y, width, height) {
    this.add("rect", { x, y, width, height, fill: this.fillStyle });
  }

  strokeRect(x, y, width, height) {
    this.add("rect", { x, y, width, height, fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth });
  }

  fillText(text, x, y) {
    const anchor = { left: "start", center: "middle", right: "end" }[this.textAlign] ?? "start";
    // Not every program knows dominant-baseline.
    const down = { top: 10, middle: 4, bottom: -3 }[this.textBaseline] ?? 0;
    this.add("text", { x, y: y + down, fill: this.fillStyle, "text-anchor": anchor }, escaped(text));
  }

  drawImage(image, x, y, width, height) {
    this.add("image", { x, y, width, height, href: image.toDataURL() });
  }
}

const escaped = (text) => String(text).replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
