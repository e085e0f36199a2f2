// The table of sets: sorted, page by page, with a choice of columns, and with the intervals that `stickslip show` prints.

const ROWS = 50;

class SetTable {
  constructor(report, select) {
    this.report = report;
    this.select = select;
    this.table = element("sets-table");
    const names = report.offered.map(({ name }) => name);
    const swept = report.swept.map(({ name }) => name);
    const usual = [
      ...swept.filter((name) => name !== "T"),
      ...(swept.includes("T") ? ["frequency", "eta"] : []),
      ...(report.status.jobs_failed ? ["failed_jobs"] : []),
      ...report.found,
    ];
    this.usual = names.filter((name) => usual.includes(name));
    const chosen = state.columns.split(" ").filter((name) => report.columns.has(name));
    this.chosen = new Set(chosen.length ? chosen : this.usual);
    element("column-list").replaceChildren(...names.map((name) => this.box(name)));
    element("earlier").addEventListener("click", () => this.turn(-1));
    element("later").addEventListener("click", () => this.turn(1));
    element("save-table").addEventListener("click", () => this.save());
    this.table.addEventListener("keydown", (event) => this.key(event));
    this.table.addEventListener("click", ({ target }) => {
      const row = target.closest("tbody tr");
      // A drag or a double click selects text.
      if (row && getSelection().isCollapsed) this.select(Number(row.dataset.set));
    });
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
    return make("label", { title: meaning }, input, ` ${label} `, make("small", {}, name));
  }

  turn(step) {
    keep({ page: String(Number(state.page) + step) });
    this.draw();
  }

  /** Saves the sets that are shown as CSV, in SI, with the ends of intervals. */
  save() {
    const isSaved = ({ name, end_of }) => name === "set_id" || this.chosen.has(end_of ?? name);
    const columns = [...this.report.columns.values()].filter(isSaved);
    const lines = this.order().map((set) => columns.map(({ values }) => values[set] ?? "").join());
    save("sets.csv", new Blob([[columns.map(({ name }) => name).join(), ...lines, ""].join("\n")], { type: "text/csv" }));
  }

  /** Up and down go from row to row; Enter selects its set. */
  key(event) {
    const row = event.target.closest("tbody tr");
    const next = { ArrowDown: row?.nextSibling, ArrowUp: row?.previousSibling }[event.key];
    if (next) {
      event.preventDefault();
      next.focus();
    } else if (event.key === "Enter" && row) this.select(Number(row.dataset.set));
  }

  /** Marks the row of the selected set. */
  mark() {
    const isSelected = ({ dataset }) => this.report.setIds[dataset.set] === state.set;
    for (const row of this.table.tBodies[0].rows) row.setAttribute("aria-selected", isSelected(row));
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
    const cells = names.map((name) => cell(this.report, name, set));
    const id = make("td", {}, make("code", {}, this.report.setIds[set].slice(0, 8)));
    return make("tr", { tabindex: "0", "data-set": set }, id, ...cells);
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
    this.mark();
    element("sets-note").textContent =
      `${counted(order.length, "set")} of ${many(this.report.setCount)}; all seeds of a set together, with 95 % intervals. The list of columns has the names used in filters and CSV, which are in SI units.`;
    element("page").textContent = `Page ${page + 1} of ${pages}`;
    element("earlier").disabled = page === 0;
    element("later").disabled = page === pages - 1;
    element("earlier").parentElement.hidden = pages === 1;
  }
}

function cell(report, name, set) {
  const kind = isNumeric(report.columns.get(name)) ? "number" : "text";
  const words = report.estimate(name, set);
  return make("td", { class: words === "–" ? `${kind} missing` : kind }, words);
}
