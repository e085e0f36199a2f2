// The data of the page: unpacked, with columns by name, numbers in words, and the state that outlives a reload.

const element = (id) => document.getElementById(id);

/** An element with attributes and children; texts become text, never HTML. */
function make(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

/** Four digits, or as many as asked for. */
function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (typeof value !== "number") return String(value);
  const size = Math.abs(value);
  if (size === 0 || (size >= 1e-3 && size < 1e6)) return String(Number(value.toPrecision(digits)));
  return Number(value.toPrecision(digits)).toExponential().replace("e+", "e");
}

/** A count with its digits in groups. */
const many = (count) => count.toLocaleString("en-US");
const counted = (count, noun) => `${many(count)} ${noun}${count === 1 ? "" : "s"}`;

/** A duration in s, in the unit that suits it. */
function duration(seconds) {
  if (seconds < 120) return `${number(seconds, 3)} s`;
  if (seconds < 7200) return `${number(seconds / 60, 3)} min`;
  if (seconds < 172800) return `${number(seconds / 3600, 3)} h`;
  return `${number(seconds / 86400, 3)} days`;
}

/** Symbol and unit of a column, as figures name it in short. */
const short = ({ symbol, unit }) => (unit ? `${symbol} (${unit})` : symbol);

/** Digits with which no two of these values look alike; those that differ by rounding are one. */
function distinguishing(values, least) {
  const distinct = (digits) => new Set(values.map((value) => value?.toPrecision(digits))).size;
  const all = distinct(10);
  let digits = least;
  while (digits < 10 && distinct(digits) < all) digits++;
  return digits;
}

/** A value of a column in the unit of its label, without that unit. */
function shownValue({ values, factor = 1, kind, digits = 3 }, place, least = 4) {
  const value = values[place];
  if (kind === "flag") return value ? "yes" : "no";
  if (kind === "count") return number(value, 16);
  return typeof value === "number" ? number(factor * value, Math.max(digits, least)) : number(value);
}

/** A value and half of its interval, or the ends of that, with the digits that it leaves, as `show` prints them. */
function withInterval(value, low, high) {
  const half = (high - low) / 2;
  if (!(half > 0)) return number(value, 3);
  const crosses = (low >= 0 && value < half) || (high <= 0 && value > -half);
  const isLopsided = crosses || Math.abs(value - low - half) > 0.2 * half;
  const exponent = Math.floor(Math.log10(half));
  const decimals = Math.min(18, Math.max(0, (isLopsided || half / 10 ** exponent < 1.95 ? 1 : 0) - exponent));
  const fixed = (end) => (Number(end.toFixed(decimals)) + 0).toFixed(decimals);
  return isLopsided ? `${fixed(value)} (${fixed(low)} to ${fixed(high)})` : `${fixed(value)} ± ${fixed(half)}`;
}

const setting = (column, place) => `${column.symbol} = ${shownValue(column, place)} ${column.unit}`.trim();

/** The values of a column in the unit of its label. */
const scaled = ({ values, factor }) =>
  (factor ?? 1) === 1 ? values : values.map((value) => (value === null ? null : factor * value));

/** Saves a file of this page. */
function save(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
const isNumeric = (column) => column.kind === "real" || column.kind === "count";
/** Whether a menu offers it: it has values, and is no end of an interval, which is shown with its value. */
const isOffered = ({ name, end_of, values }) =>
  name !== "set_id" && end_of === null && values.some((value) => value !== null && !Number.isNaN(value));
/** The columns of a table by name, each with its values. */
const byName = ({ columns, values }) =>
  new Map(columns.map((column, k) => [column.name, { ...column, values: values[k] }]));

/** Unpacks the page's data. */
async function unpack() {
  const text = atob(element("data").textContent);
  const packed = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) packed[k] = text.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Report(await new Response(stream).json());
}

class Report {
  constructor(content) {
    Object.assign(this, content);
    this.columns = byName(content.sets);
    this.setIds = this.columns.get("set_id").values;
    this.setCount = this.setIds.length;
    this.placeOf = new Map(this.setIds.map((id, place) => [id, place]));
    this.readSlips();
    useInks(content);
    const parameters = this.parameters.map((key) => this.columns.get(key));
    for (const column of [...parameters, this.columns.get("eta"), this.columns.get("frequency")]) {
      if (column && isNumeric(column)) column.digits = distinguishing(column.values, 3);
    }
    for (const column of this.columns.values()) {
      const explained = this.columns.get(column.by_drive);
      if (explained) column.meaning = column.meaning.replace("the same", explained.meaning.split(":")[0]);
    }
    this.offered = [...this.columns.values()].filter(isOffered);
    const isSwept = ({ values }) => new Set(values).size > 1;
    this.swept = parameters.filter(isSwept);
    this.fixed = parameters.filter((parameter) => !isSwept(parameter));
    this.isModulated = this.slip.get("phase").values.some((phase) => !Number.isNaN(phase));
  }

  /** The values of a column of the sets. */
  values(name) {
    return this.columns.get(name).values;
  }

  /** Columns of slips as numbers, NaN where there is none, and two that follow from them. */
  readSlips() {
    const { columns, values, job, jobs } = this.slips;
    const numbers = (column) => Float32Array.from(column, (value) => value ?? NaN);
    this.slipJob = Uint32Array.from(job);
    this.slipSet = Uint32Array.from(job, (number) => jobs[number][0]);
    this.slip = byName({ columns, values: values.map(numbers) });
    const derive = (name, label, symbol, meaning, of) =>
      this.slip.set(name, { name, label, symbol, unit: "", meaning, kind: "real", values: Float32Array.from(this.slipSet, of) });
    const [velocity, period] = [this.values("V0"), this.slip.get("T_onset").values];
    const [amplitude, interval] = [this.slip.get("Delta_onset").values, this.slip.get("interval").values];
    derive("eta", "η = 2πΔ / (T V₀)", "η", "2 pi Delta / (T V0) at the onset; 0 without modulation", (set, slip) =>
      Number.isNaN(period[slip]) ? 0 : (2 * Math.PI * amplitude[slip]) / (period[slip] * velocity[set]),
    );
    derive("tau / T", "τ / T", "τ / T", "interval in periods at the onset", (_, slip) => interval[slip] / period[slip]);
  }

  /** A value of a set with its 95 % interval, or its bound, in the unit of its label, without that unit. */
  estimate(name, set) {
    const column = this.columns.get(name);
    const columns = [...this.columns.values()];
    const value = (of) => column.factor * (of?.values[set] ?? NaN);
    const bound = value(columns.find(({ bound_of }) => bound_of === name));
    if (bound > 0) return `> ${number(bound, 3)}`;
    const [low, high] = columns.filter(({ end_of }) => end_of === name).map(value);
    return Number.isNaN(low ?? NaN) ? shownValue(column, set, 3) : withInterval(value(column), low, high);
  }

  /** The command that runs one job of a set alone; measured slips have none. */
  command(set, seed) {
    if (this.sets.commands.length === 0) return "measured";
    return `${this.sets.commands[set]} --set seed=${seed} ${this.sets.command_end}`.trim();
  }

  /** Seeds of the jobs of a set with a slip on the page. */
  seeds(set) {
    return this.slips.jobs.filter(([of]) => of === set).map(([, seed]) => seed);
  }

  /** The swept parameters of a set, as a line. */
  settings(set) {
    const given = this.swept.filter(({ values }) => values[set] !== null);
    return given.map((column) => setting(column, set)).join(", ");
  }

  name(set) {
    return `set ${this.setIds[set].slice(0, 8)}`;
  }
}

// What the reader has chosen: in the fragment of the address, so that it survives a reload and can be shared.
const state = {
  set: "",
  filter: "",
  kind: "",
  colour: "",
  sort: "",
  page: "0",
  columns: "",
  of: "",
  x: "",
  y: "",
  logx: "",
  logy: "",
};

function readState() {
  for (const [key, value] of new URLSearchParams(location.hash.slice(1))) {
    if (Object.hasOwn(state, key)) state[key] = value;
  }
}

function keep(changes) {
  Object.assign(state, changes);
  const given = Object.entries(state).filter(([key, value]) => value !== "" && !(key === "page" && value === "0"));
  history.replaceState(null, "", `#${new URLSearchParams(given)}`);
}

/** Notes that are of use after a reload only. A browser may refuse them. */
const notes = {
  get(key) {
    try {
      return JSON.parse(sessionStorage.getItem(`stickslip ${location.pathname} ${key}`));
    } catch {
      return null;
    }
  },
  set(key, value) {
    try {
      sessionStorage.setItem(`stickslip ${location.pathname} ${key}`, JSON.stringify(value));
    } catch {
      // The page works without.
    }
  },
};
