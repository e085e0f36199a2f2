// Charts of all sets, and what is said of their points.

class Explorer {
  constructor(report, select) {
    this.report = report;
    this.select = select;
    this.selected = -1;
    const modulated = report.isModulated;
    element("slips").hidden = document.querySelector("nav a[href='#slips']").hidden = !modulated;
    if (modulated) {
      this.phase = new Chart(element("phi-eta"), "φ against η");
      this.ratio = new Chart(element("tau-T"), "τ / T");
    }
    this.free = new Chart(element("free"), "Sets");
    this.setView = new SetView(report, this);
    this.defaults();
    this.fillTools();
  }

  /** What the free chart and the colours show at first. */
  defaults() {
    const { report } = this;
    // As in the figure: the most values make the axis, the next the colours.
    const numeric = report.sets.swept.filter(([key]) => isNumeric(report.columns.get(key)));
    const [first] = numeric.map(([key]) => key);
    const colour = report.sets.swept.map(([key]) => key).find((key) => key !== first) ?? "";
    // What the sweep decides by, what its controls are for, or what the paper asks of the amplitude; else what there is.
    const hasValues = (key) => report.columns.get(key)?.values.some((value) => value !== null);
    const answer = hasValues("resultant_drive") ? "resultant_length" : first === "Delta" ? "mean_friction" : "tau_mean";
    const y = [...report.asked, answer, "tau_mean", "mean_friction"].find(hasValues) ?? "tau_mean";
    this.usual = { colour, of: "sets", x: first ?? "tau_mean", y: first ? y : "mean_friction" };
  }

  chosen(key) {
    return state[key] || this.usual[key];
  }

  table() {
    return this.chosen("of") === "slips" ? this.slipColumns() : this.report.columns;
  }

  /** Columns of slips, and those of their sets. */
  slipColumns() {
    const { report } = this;
    const columns = new Map(report.slip);
    for (const column of report.swept.filter(isNumeric)) {
      columns.set(column.name, { ...column, values: Array.from(report.slipSet, (set) => column.values[set]) });
    }
    return columns;
  }

  fillTools() {
    const { report } = this;
    const option = (value, words, chosen) => make("option", { value, selected: value === chosen }, words);
    const colour = element("colour");
    const names = report.offered.filter(({ values }) => new Set(values).size > 1);
    colour.replaceChildren(
      option("-", "one colour", this.chosen("colour")),
      ...names.map((column) => option(column.name, column.label, this.chosen("colour"))),
    );
    colour.addEventListener("change", () => {
      keep({ colour: colour.value });
      this.draw();
    });
    this.fillFree();
  }

  /** The controls of the free chart. */
  fillFree() {
    const redraw = (changes) => {
      keep(changes);
      this.fillFree();
      this.drawFree();
    };
    const choice = (label, key, options) => {
      const select = make("select", {
        onchange: () =>
          redraw(
            key === "of"
              ? { of: select.value, x: "", y: "", logx: "", logy: "" }
              : { [key]: select.value, [`log${key}`]: "" },
          ),
      });
      select.replaceChildren(
        ...options.map(([value, words]) => make("option", { value, selected: value === this.axisName(key) }, words)),
      );
      return make("label", {}, label, select);
    };
    const columns = [...this.table().values()].filter(isNumeric).filter(isOffered).map((column) => [column.name, column.label]);
    const log = (key) => {
      const box = make("input", {
        type: "checkbox",
        checked: this.isLog(key),
        onchange: () => redraw({ [`log${key}`]: box.checked ? "yes" : "no" }),
      });
      return make("label", { class: "inline" }, box, `log ${key}`);
    };
    const of = choice("Of", "of", [
      ["sets", "sets"],
      ["slips", "slips"],
    ]);
    const focused = document.activeElement?.closest?.("#free label")?.firstChild?.textContent;
    this.free.controls.className = "tools controls";
    this.free.controls.replaceChildren(of, choice("y", "y", columns), choice("x", "x", columns), log("x"), log("y"), this.saveButton());
    if (focused)
      [...this.free.controls.children]
        .find((label) => label.firstChild.textContent === focused)
        ?.querySelector("select")
        ?.focus();
  }

  /** A button that saves the visible chart on the background of the page. */
  saveButton() {
    const onclick = () => {
      const { base } = this.free;
      const copy = Object.assign(document.createElement("canvas"), { width: base.width, height: base.height });
      const ctx = copy.getContext("2d");
      ctx.fillStyle = getComputedStyle(document.body).backgroundColor;
      ctx.fillRect(0, 0, copy.width, copy.height);
      ctx.drawImage(base, 0, 0);
      copy.toBlob((blob) => save(`${this.report.status.name}.png`, blob));
    };
    return make("button", { type: "button", onclick }, "Save as PNG");
  }

  /** The column of an axis of the free chart. */
  axisName(key) {
    if (key === "of") return this.chosen("of");
    const usual = this.chosen("of") === "slips" ? { x: "slip", y: "interval" }[key] : this.usual[key];
    return this.table().has(state[key]) ? state[key] : usual;
  }

  /** Logarithmic if asked for, or by itself if values span more than a factor of 30. */
  isLog(key) {
    const choice = state[`log${key}`];
    if (choice) return choice === "yes";
    const swept = this.report.sets.swept.find(([name]) => name === this.axisName(key));
    if (swept) return swept[1];
    const { values } = this.table().get(this.axisName(key));
    let [low, high] = [Infinity, 0];
    for (const value of values) {
      if (value === null || Number.isNaN(value)) continue;
      if (value <= 0) return false;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    return high / low > 30;
  }

  /** Shows these sets alone. */
  filter(shown) {
    this.shown = shown;
    this.draw();
  }

  draw() {
    const { report, shown } = this;
    const { group, groups } = colouring(report, this.chosen("colour"));
    this.colours = groups.map(([colour]) => colour);
    this.setGroup = group.map((value, set) => (shown[set] ? value : HIDDEN));
    this.slipGroup = Uint8Array.from(report.slipSet, (set) => this.setGroup[set]);
    const used = new Set(this.setGroup);
    const isSeen = ([, words], k) =>
      words && (used.has(k) || groups.length > CATEGORIES.light.length + 2) && (words !== "none" || used.has(k));
    element("legend").replaceChildren(
      ...groups.filter(isSeen).map(([colour, words]) => {
        const swatch = make("span", { class: "swatch" });
        swatch.style.background = colour;
        return make("li", {}, swatch, words);
      }),
    );
    if (report.isModulated) {
      this.drawPhase();
      this.drawRatio();
    }
    this.drawFree();
    this.setView.draw();
  }

  /** What is said of a slip. */
  slipTip(slip, shown = []) {
    const { report } = this;
    const set = report.slipSet[slip];
    const seed = report.slips.jobs[report.slipJob[slip]][1];
    const names = ["phase", "eta", "interval", "tau / T", ...shown].filter((name) => report.slip.has(name));
    const given = [...new Set(names)].filter((name) => !Number.isNaN(report.slip.get(name).values[slip]));
    return [
      make("strong", {}, `${report.name(set)}, seed ${seed}, slip ${report.slip.get("slip").values[slip]}`),
      report.settings(set),
      given.map((name) => setting(report.slip.get(name), slip)).join(", "),
      make("code", { class: "command" }, report.command(set, seed)),
    ];
  }

  /** What is said of a set. */
  setTip(set, names) {
    const { report } = this;
    const given = names.map((name) => setting(report.columns.get(name), set));
    return [
      make(
        "strong",
        {},
        `${report.name(set)}: ${counted(report.values("jobs")[set], "job")}, ${counted(report.values("slips")[set], "slip")}`,
      ),
      report.settings(set),
      given.join(", "),
      make("code", { class: "command" }, report.command(set, report.seeds(set)[0] ?? 0)),
    ];
  }

  slipLayers(x, y, size = 2) {
    const { report } = this;
    const pick = (slip) => this.select(report.slipSet[slip]);
    const tip = (slip) => this.slipTip(slip);
    const all = { type: "points", x, y, group: this.slipGroup, colours: this.colours, size, alpha: 0.6, tip, pick };
    const own = Uint8Array.from(report.slipSet, (set) => (set === this.selected ? 0 : HIDDEN));
    const marked = { type: "points", x, y, group: own, colours: [cssColour("mark")], size: size + 1.5 };
    return this.selected < 0 ? [all] : [all, marked];
  }

  drawPhase() {
    const { report } = this;
    const [eta, phase] = ["eta", "phase"].map((name) => report.slip.get(name).values);
    const red = ink({ light: "#c22f1c", dark: "#ff7a66" });
    const mean = cssColour("ink");
    const curve = (k) => ({
      x: report.curves.map(([at]) => at),
      y: report.curves.map((point) => point[k]),
      type: "line",
      colour: red,
    });
    const bins = byName(report.backbone);
    const [from, to, means, low, high] = [
      "eta_low",
      "eta_high",
      "set_phase_mean",
      "set_phase_mean_low",
      "set_phase_mean_high",
    ].map((name) => bins.get(name).values);
    // At the mean of their sets, as in the figure.
    const centre = from.map((least, bin) => {
      const isIn = (eta, set) => report.values("has_phase")[set] && eta >= least && eta < to[bin];
      const logs = report.values("eta").filter(isIn).map(Math.log);
      return Math.exp(logs.reduce((sum, log) => sum + log, 0) / logs.length);
    });
    const binTip = (k) => [
      make("strong", {}, `${counted(bins.get("phased_sets").values[k], "set")} with a phase at η = ${number(centre[k])}`),
      `mean φ = ${number(means[k])} rad, 95 %: ${number(low[k])} to ${number(high[k])} rad`,
    ];
    this.phase.show({
      x: { label: report.slip.get("eta").label, log: true },
      y: { label: "φ (rad)" },
      layers: [
        ...this.slipLayers(eta, phase),
        { ...curve(1), dash: [5, 4] },
        curve(2),
        { type: "intervals", x: centre, low, high, colour: mean, mayLeave: true },
        { type: "points", x: centre, y: means, colours: [mean], size: 4, tip: binTip },
      ],
      key: [
        [mean, "mean of sets with a phase, 95 %"],
        [red, "−2√(π/η); dashed: φₘᵢₙ of Eq. 2", "stroke"],
      ],
      empty: "no slip under modulation",
    });
  }

  drawRatio() {
    const { report } = this;
    const [period, ratio] = ["T_onset", "tau / T"].map((name) => scaled(report.slip.get(name)));
    const [low, high] = extremes(ratio, this.slipGroup);
    const whole = [1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200, 500, 1000].filter(
      (n) => n > 0.7 * low && n < 1.1 * high,
    );
    const ends = extremes(period, this.slipGroup);
    const line = (n) => ({
      type: "line",
      x: [ends[0] / 2, ends[1] * 2],
      y: [n, n],
      colour: cssColour("line"),
      width: 1,
      label: `n = ${n}`,
    });
    this.ratio.show({
      x: { label: short(report.slip.get("T_onset")), log: true },
      y: { label: "τ / T", log: true },
      layers: [...whole.map(line), ...this.slipLayers(period, ratio)],
      key: [[cssColour("line"), "whole numbers of periods", "stroke"]],
      empty: "no interval under modulation",
    });
  }

  /** Lines between sets that differ in a swept parameter alone, if that is x. */
  lines(x, { x: at, y: up }) {
    const { swept } = this.report.sets;
    if (!swept.some(([name]) => name === x.name)) return [];
    const others = swept.filter(([name]) => name !== x.name).map(([name]) => this.report.values(name));
    const lines = new Map();
    for (let set = 0; set < at.length; set++) {
      if (this.setGroup[set] === HIDDEN || at[set] === null || up[set] === null) continue;
      // Numbers that were computed from others differ by rounding.
      const key = others.map((values) => number(values[set], 10)).join();
      lines.set(key, [...(lines.get(key) ?? []), set]);
    }
    const many = [...lines.values()].filter((line) => line.length > 1);
    if (many.length > 24) return [];
    return many.map((line) => {
      const sets = line.sort((a, b) => at[a] - at[b]);
      const colour = this.colours[this.setGroup[sets[0]]];
      return { type: "line", x: sets.map((set) => at[set]), y: sets.map((set) => up[set]), colour, width: 1 };
    });
  }

  drawFree() {
    const { report } = this;
    const [x, y] = ["x", "y"].map((key) => this.table().get(this.axisName(key)));
    const axis = (column, key) => ({ label: column.label, log: this.isLog(key), few: fewOf(scaled(column)) });
    const axes = { x: axis(x, "x"), y: axis(y, "y") };
    const key = [
      ["transparent", `y: ${y.meaning}`],
      ["transparent", `x: ${x.meaning}`],
    ];
    if (this.chosen("of") === "slips") {
      const layers = this.slipLayers(scaled(x), scaled(y)).map((layer) =>
        layer.tip ? { ...layer, tip: (slip) => this.slipTip(slip, [x.name, y.name]) } : layer,
      );
      this.free.show({ ...axes, layers, key });
      return;
    }
    const pick = (set) => this.select(set);
    const tip = (set) => this.setTip(set, [...new Set([x.name, y.name])]);
    const at = scaled(x);
    const up = (values) => scaled({ values, factor: y.factor });
    const points = {
      type: "points",
      x: at,
      y: up(y.values),
      group: this.setGroup,
      colours: this.colours,
      size: 4,
      alpha: 0.85,
      tip,
      pick,
    };
    const drive = report.offered.find(({ by_drive }) => by_drive === y.name);
    const alone = drive
      ? [
          {
            ...points,
            y: up(drive.values),
            group: this.setGroup.map((group) => (group === HIDDEN ? group : 0)),
            colours: [cssColour("muted")],
            size: 2.5,
            tip: (set) => this.setTip(set, [x.name, drive.name]),
          },
        ]
      : [];
    if (drive) key.push([cssColour("muted"), "by the drive alone"]);
    const ends = ["low", "high"].map((end) => report.columns.get(`${y.name}_${end}`)?.values);
    const bars = ends[0]
      ? [
          {
            type: "intervals",
            x: at,
            low: up(ends[0]),
            high: up(ends[1]),
            group: this.setGroup,
            colour: cssColour("ink"),
          },
        ]
      : [];
    const own =
      this.selected < 0
        ? []
        : [
            {
              ...points,
              tip: null,
              group: this.setGroup.map((_, set) => (set === this.selected ? 0 : HIDDEN)),
              colours: [cssColour("mark")],
              size: 6,
              alpha: 1,
            },
          ];
    if (bars.length) key.push(["transparent", "vertical bars: 95 % confidence interval"]);
    this.free.show({ ...axes, layers: [...this.lines(x, points), ...bars, ...alone, points, ...own], key });
  }
}

/** The smallest and largest number > 0 of those that are shown. */
function extremes(values, group) {
  let [low, high] = [Infinity, 0];
  for (let k = 0; k < values.length; k++) {
    if (group[k] === HIDDEN || !(values[k] > 0)) continue;
    if (values[k] < low) low = values[k];
    if (values[k] > high) high = values[k];
  }
  return [low, high];
}
