// Colours of sets: by a column, in light and dark.

const DISTINCT = 8;
const CATEGORIES = {
  light: ["#0072b2", "#d55e00", "#009e73", "#b0408f", "#b07d00", "#3a9bd9", "#6b4ea0", "#8a4b2d"],
  dark: ["#5eb5f0", "#ff9a5c", "#3fd0a4", "#f08fd0", "#f0c04a", "#9ad5ff", "#b79cf0", "#e0a98a"],
};
const GRADIENT = {
  light: [
    [62, 38, 130],
    [49, 104, 142],
    [33, 145, 140],
    [74, 180, 90],
    [176, 190, 20],
  ],
  dark: [
    [120, 110, 220],
    [70, 140, 190],
    [50, 175, 165],
    [110, 205, 100],
    [240, 225, 60],
  ],
};
const PALE = { light: "#aeb8c2", dark: "#5a6672" };
const REGIMES = ["stick-slip", "mixed", "sliding"];
const ink = (colours) => colours[isDark() ? "dark" : "light"];

/** A colour of the gradient, at a place from 0 to 1. */
function gradient(place) {
  const stops = ink(GRADIENT);
  const at = Math.min(0.9999, Math.max(0, place)) * (stops.length - 1);
  const [low, high] = [stops[Math.floor(at)], stops[Math.floor(at) + 1]];
  return `rgb(${low.map((value, k) => Math.round(value + (at % 1) * (high[k] - value))).join(" ")})`;
}

/** Colours of the sets by a column: of each set its group, and of each group its colour and its words. */
function colouring(report, name) {
  const column = report.columns.get(name);
  const group = new Uint8Array(report.setCount);
  if (!column) return { group, groups: [[ink(CATEGORIES)[0], ""]] };
  const { values } = column;
  const distinct = [...new Set(values)].filter((value) => value !== null);
  const none = [ink(PALE), "none"];
  if (!isNumeric(column)) {
    const words = name === "regime" ? REGIMES : distinct.sort();
    values.forEach((value, set) => (group[set] = value === null ? words.length : words.indexOf(value)));
    const shade = (value, k) =>
      value === false ? ink(PALE) : ink(CATEGORIES)[column.kind === "flag" ? 0 : k % DISTINCT];
    const word = (value) => (column.kind === "flag" ? (value ? name : `not ${name}`) : value);
    return { group, groups: [...words.map((value, k) => [shade(value, k), word(value)]), none] };
  }
  distinct.sort((a, b) => a - b);
  const [low, high] = [distinct[0], distinct[distinct.length - 1]];
  if (distinct.length <= DISTINCT) {
    values.forEach((value, set) => (group[set] = value === null ? distinct.length : distinct.indexOf(value)));
    const shades = distinct.map((value, k) => [
      gradient(k / Math.max(1, distinct.length - 1)),
      `${column.short} = ${number(column.factor * value)}`,
    ]);
    return { group, groups: [...shades, none] };
  }
  const axis = new Axis({ label: "", log: low > 0 && high / low > 30, low, high });
  const steps = 24;
  values.forEach(
    (value, set) => (group[set] = value === null ? steps : Math.min(steps - 1, Math.floor(axis.place(value) * steps))),
  );
  const legend = (k) =>
    k % 6 === 0 || k === steps - 1
      ? `${k ? "" : `${column.short}: `}${number(column.factor * axis.value(k === steps - 1 ? 1 : k / steps), 3)}`
      : "";
  return { group, groups: [...Array.from({ length: steps }, (_, k) => [gradient(k / (steps - 1)), legend(k)]), none] };
}
