// The filter of sets, and their table: sorted, page by page, with a choice of columns.

const ROWS = 50;
const COMPARISON = /^([A-Za-z]\w*)(<=|>=|!=|==|=|<|>)(.+)$/;

const same = (one, other) => Math.abs(one - other) <= 1e-4 * Math.max(Math.abs(one), Math.abs(other));
const COMPARE = {
  "<": (a, b) => a < b,
  ">": (a, b) => a > b,
  "<=": (a, b) => a <= b || same(a, b),
  ">=": (a, b) => a >= b || same(a, b),
  "=": same,
  "!=": (a, b) => !same(a, b),
};

/** What a word of the filter asks of a set, or a text that says what is wrong with it. */
function condition(report, word) {
  const found = COMPARISON.exec(word);
  if (!found) {
    const texts = [...report.columns.values()].filter(({ kind }) => kind === "text");
    return (set) => texts.some(({ values }) => values[set]?.toLowerCase().includes(word));
  }
  const [, name, sign, wanted] = found;
  const column = [...report.columns.values()].find((other) => other.name.toLowerCase() === name);
  if (!column) return `There is no column ${name}.`;
  const { values, kind } = column;
  const operator = sign === "==" ? "=" : sign;
  if (isNumeric(column)) {
    const bound = Number(wanted);
    if (Number.isNaN(bound)) return `${column.name} is compared with a number, not with ${wanted}.`;
    return (set) => values[set] !== null && COMPARE[operator](values[set], bound);
  }
  if (operator !== "=" && operator !== "!=") return `${column.name} holds ${kind}s: compare it by = or !=.`;
  return (set) => (String(values[set]).toLowerCase() === wanted) === (operator === "=");
}

/** Which sets fulfil all words of a filter, and what is wrong with it. */
function filtered(report, text) {
  const words = text
    .toLowerCase()
    .replace(/\s*(<=|>=|!=|==|=|<|>)\s*/g, "$1")
    .split(/\s+/)
    .filter(Boolean);
  const conditions = words.map((word) => condition(report, word));
  const problems = conditions.filter((one) => typeof one === "string");
  const tests = conditions.filter((one) => typeof one !== "string");
  const shown = Uint8Array.from({ length: report.setCount }, (_, set) => (tests.every((test) => test(set)) ? 1 : 0));
  return { shown, problems };
}

class SetTable {
  constructor(report, select) {
    this.report = report;
    this.select = select;
    this.table = element("sets-table");
    const names = [...report.columns.keys()];
    const usual = [
      ...report.swept.map(({ name }) => name),
      ...(report.isModulated ? ["eta"] : []),
      "jobs",
      ...(report.status.jobs_failed ? ["failed_jobs"] : []),
      ...["regime", "slips", "tau_mean", "tau_sd"],
      ...(report.isModulated ? ["locking_index", "phase_mean", "has_phase", "resultant_length"] : []),
      ...(report.hasControls ? ["resultant_drive", "resultant_excess", "locking_index_excess"] : []),
      ...["drop_mean", "mean_friction"],
    ];
    this.usual = names.filter((name) => usual.includes(name) && name !== "set_id");
    const chosen = state.columns.split(" ").filter((name) => report.columns.has(name));
    this.chosen = new Set(chosen.length ? chosen : this.usual);
    element("column-list").replaceChildren(...names.filter((name) => name !== "set_id").map((name) => this.box(name)));
    element("earlier").addEventListener("click", () => this.turn(-1));
    element("later").addEventListener("click", () => this.turn(1));
    element("save-table").addEventListener("click", () => this.save());
    this.table.addEventListener("keydown", (event) => this.key(event));
  }

  box(name) {
    const toggle = ({ target }) => {
      if (target.checked) this.chosen.add(name);
      else this.chosen.delete(name);
      const names = [...this.report.columns.keys()].filter((other) => this.chosen.has(other));
      keep({ columns: names.join(" ") === this.usual.join(" ") ? "" : names.join(" ") });
      this.draw();
    };
    const { label, meaning } = this.report.columns.get(name);
    const input = make("input", { type: "checkbox", checked: this.chosen.has(name), onchange: toggle });
    return make("label", { title: `${name}: ${meaning}` }, input, ` ${label}`);
  }

  turn(step) {
    keep({ page: String(Number(state.page) + step) });
    this.draw();
  }

  /** Saves the sets that are shown as CSV, in SI. */
  save() {
    const columns = [...this.report.columns.values()].filter(({ name }) => name === "set_id" || this.chosen.has(name));
    const lines = this.order().map((set) => columns.map(({ values }) => values[set] ?? "").join());
    save("sets.csv", new Blob([[columns.map(({ name }) => name).join(), ...lines, ""].join("\n")], { type: "text/csv" }));
  }

  /** Up and down go from set to set. */
  key(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step || !event.target.closest("tbody")) return;
    const buttons = [...this.table.querySelectorAll("tbody button")];
    const next = buttons[buttons.indexOf(event.target) + step];
    if (next) {
      event.preventDefault();
      next.focus();
    }
  }

  /** The sets that are shown, in order. */
  order() {
    const sets = [...this.shown.keys()].filter((set) => this.shown[set]);
    const [name, direction] = state.sort.split(" ");
    const column = this.report.columns.get(name);
    if (!column) return sets;
    const sign = direction === "down" ? -1 : 1;
    const { values } = column;
    return sets.sort((a, b) => {
      const [left, right] = [values[a], values[b]];
      // What is missing comes last, whatever the direction.
      if (left === null || right === null) return (left === null) - (right === null) || a - b;
      return (left < right ? -sign : left > right ? sign : 0) || a - b;
    });
  }

  head(name) {
    const [sorted, direction] = state.sort.split(" ");
    const column = this.report.columns.get(name);
    const isSorted = sorted === name;
    const next = isSorted ? (direction === "up" ? `${name} down` : "") : `${name} up`;
    const sort = () => {
      keep({ sort: next, page: "0" });
      this.draw();
      this.table.querySelector(`th[data-column="${name}"] button`)?.focus();
    };
    const order = isSorted ? (direction === "up" ? "ascending" : "descending") : null;
    const attributes = {
      scope: "col",
      "data-column": name,
      "aria-sort": order,
      title: `${name}: ${column.meaning}`,
      class: isNumeric(column) ? "number" : "text",
    };
    return make(
      "th",
      attributes,
      make("button", { type: "button", onclick: sort }, column.symbol),
      make("small", {}, column.unit || " "),
    );
  }

  row(set, names) {
    const choose = () => this.select(set);
    const cells = names.map((name) => cell(this.report.columns.get(name), set));
    const button = make("button", { type: "button", onclick: choose }, this.report.setIds[set].slice(0, 8));
    const isSelected = this.report.setIds[set] === state.set;
    return make("tr", { "aria-selected": String(isSelected), "data-set": set }, make("td", {}, button), ...cells);
  }

  draw(shown = this.shown) {
    this.shown = shown;
    const order = this.order();
    const pages = Math.max(1, Math.ceil(order.length / ROWS));
    const page = Math.min(Math.max(0, Number(state.page) || 0), pages - 1);
    const names = [...this.report.columns.keys()].filter((name) => this.chosen.has(name));
    const first = make("th", { scope: "col" }, "set", make("small", {}, " "));
    const head = make("thead", {}, make("tr", {}, first, ...names.map((name) => this.head(name))));
    const rows = order.slice(page * ROWS, (page + 1) * ROWS).map((set) => this.row(set, names));
    this.table.replaceChildren(head, make("tbody", {}, ...rows));
    element("sets-note").textContent =
      `${counted(order.length, "set")} of ${many(this.report.setCount)}; all seeds of a set together. Hover over a heading for the name used in filters and CSV, which are in SI units.`;
    element("page").textContent = `Page ${page + 1} of ${pages}`;
    element("earlier").disabled = page === 0;
    element("later").disabled = page === pages - 1;
    element("earlier").parentElement.hidden = pages === 1;
  }
}

function cell(column, place) {
  const kind = isNumeric(column) ? "number" : "text";
  if (column.values[place] === null) return make("td", { class: `${kind} missing` }, "–");
  return make("td", { class: kind }, shownValue(column, place, 5));
}
