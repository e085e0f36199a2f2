// What charts draw with on a canvas, as SVG.

class SvgContext {
  constructor(width, height, background) {
    // The parser knows the name space.
    const outer = make("div");
    outer.innerHTML = "<svg>";
    this.root = this.parent = outer.firstChild;
    const sides = { width, height, viewBox: `0 0 ${width} ${height}` };
    for (const [key, value] of Object.entries({ ...sides, "font-family": "system-ui, sans-serif", "font-size": 12 }))
      this.root.setAttribute(key, value);
    Object.assign(this, { lineWidth: 1, globalAlpha: 1, dash: [], place: "", stack: [] });
    this.fillStyle = background;
    this.fillRect(0, 0, width, height);
  }

  text() {
    return new XMLSerializer().serializeToString(this.root);
  }

  /** An element with what holds for all: opacity, clip, place. */
  add(name, attributes, content = "") {
    const common = { opacity: this.globalAlpha === 1 ? "" : this.globalAlpha, transform: this.place };
    const element = document.createElementNS(this.root.namespaceURI, name);
    for (const [key, value] of Object.entries({ ...attributes, ...common }))
      if (value !== "") element.setAttribute(key, typeof value === "number" ? +value.toFixed(2) : value);
    element.textContent = content;
    return this.parent.appendChild(element);
  }

  save() {
    const { place, parent } = this;
    this.stack.push({ place, parent });
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
    this.box = [x, y, width, height];
  }

  /** A whole circle. */
  arc(x, y, radius) {
    const [left, across] = [x - radius, 2 * radius];
    this.path += `M${left.toFixed(2)} ${y.toFixed(2)}a${radius} ${radius} 0 1 0 ${across} 0a${radius} ${radius} 0 1 0 ${-across} 0`;
  }

  /** To the rectangle of the path: an inner image shows nothing outside. */
  clip() {
    const [x, y, width, height] = this.box;
    this.parent = this.add("svg", { x, y, width, height, viewBox: this.box.join(" ") });
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
    this.add("text", { x, y: y + down, fill: this.fillStyle, "text-anchor": anchor }, text);
  }

  drawImage(image, x, y, width, height) {
    this.add("image", { x, y, width, height, href: image.toDataURL() });
  }
}
