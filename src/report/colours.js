// Colours of sets: by a column, in light and dark.

/** Inks and scale of the figures; on a dark ground with more white. */
const CATEGORIES = { light: [], dark: [] };
const GRADIENT = { light: [], dark: [] };
const PALE = { light: "#aeb8c2", dark: "#5a6672" };
const REGIMES = ["stick-slip", "mixed", "sliding"];
const ink = (colours) => colours[isDark() ? "dark" : "light"];

function useInks({ inks, scale }) {
  const lighter = (colour) => `rgb(${components(colour).map((part) => Math.round(part + 0.35 * (255 - part))).join(" ")})`;
  Object.assign(CATEGORIES, { light: inks, dark: inks.map(lighter) });
  // What is near the ground is pale in either.
  Object.assign(GRADIENT, { light: scale, dark: scale.map(lighter).reverse() });
}

/** A colour of the scale, at a place from 0 to 1. */
const gradient = (place) => ink(GRADIENT)[Math.min(ink(GRADIENT).length - 1, Math.floor(place * ink(GRADIENT).length))];

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
      value === false ? ink(PALE) : ink(CATEGORIES)[column.kind === "flag" ? 0 : k % CATEGORIES.light.length];
    const word = (value) => (column.kind === "flag" ? (value ? name : `not ${name}`) : value);
    return { group, groups: [...words.map((value, k) => [shade(value, k), word(value)]), none] };
  }
  distinct.sort((a, b) => a - b);
  const [low, high] = [distinct[0], distinct[distinct.length - 1]];
  if (distinct.length <= CATEGORIES.light.length) {
    values.forEach((value, set) => (group[set] = value === null ? distinct.length : distinct.indexOf(value)));
    // What is off is black, as in figures.
    const first = low === 0 ? 1 : 0;
    const shades = distinct.map((value, k) => [
      k < first ? cssColour("ink") : ink(CATEGORIES)[k - first],
      setting(column, values.indexOf(value)),
    ]);
    return { group, groups: [...shades, none] };
  }
  const axis = new Axis({ label: "", log: low > 0 && high / low > 30, low, high });
  const steps = 24;
  const ends = Array.from({ length: steps + 1 }, (_, k) => column.factor * axis.value(k / steps));
  const digits = distinguishing(ends.filter((_, k) => k % 6 === 0), 3);
  values.forEach(
    (value, set) => (group[set] = value === null ? steps : Math.min(steps - 1, Math.floor(axis.place(value) * steps))),
  );
  const legend = (k) =>
    k % 6 === 0 || k === steps - 1
      ? `${k ? "" : `${short(column)}: `}${number(ends[k === steps - 1 ? steps : k], digits)}`
      : "";
  return { group, groups: [...Array.from({ length: steps }, (_, k) => [gradient(k / (steps - 1)), legend(k)]), none] };
}
