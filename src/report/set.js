// The selected set: its intervals, its slips over time, its statistics and its command.

class SetView {
  constructor(report, explorer) {
    this.report = report;
    this.explorer = explorer;
    this.histogram = new Chart(element("histogram"), "τ");
    this.sequence = new Chart(element("sequence"), report.isModulated ? "Phases over time" : "Intervals over time");
  }

  /** Charts and facts of the selected set; without one, the intervals of all that are shown. */
  draw() {
    const { report } = this;
    const { selected, shown } = this.explorer;
    const colour = selected < 0 ? ink(CATEGORIES)[0] : cssColour("mark");
    const mean = report.values("tau_mean");
    const counts = new Map();
    const add = (set) => {
      const bins = report.sets.histograms[set];
      for (let k = 0; k < bins.length; k += 2) counts.set(bins[k], (counts.get(bins[k]) ?? 0) + bins[k + 1]);
    };
    if (selected < 0) shown.forEach((isShown, set) => isShown && add(set));
    else add(selected);
    const total = [...counts.values()].reduce((sum, count) => sum + count, 0);
    const bins = [...counts.keys()].sort((a, b) => a - b);
    const { factor, unit } = report.columns.get("tau_mean");
    const width = (selected < 0 ? 1 : factor * (mean[selected] ?? 1)) / 60;
    const y = bins.map((bin) => counts.get(bin));
    const tip = (k) => [
      `${number(bins[k] * width)} to ${number((bins[k] + 1) * width)}${selected < 0 ? "" : ` ${unit}`}: ${counted(y[k], "interval")}`,
    ];
    const period = selected < 0 ? null : report.values("T")[selected];
    const multiples =
      period && report.values("ramp_time")[selected] === 0 ? this.multiples(factor * period, bins, width, y) : [];
    this.histogram.title = selected < 0 ? "τ of all sets that are shown" : "τ of the set";
    this.histogram.show({
      x: { label: selected < 0 ? "τ / mean τ of its set" : `interval τ (${unit})` },
      y: { label: `intervals, of ${many(total)}`, whole: true },
      layers: [
        ...multiples,
        {
          type: "bars",
          low: bins.map((bin) => bin * width),
          high: bins.map((bin) => (bin + 1) * width),
          y,
          colour,
          tip,
        },
      ],
      key: multiples.length ? [[cssColour("muted"), "whole numbers of periods", "stroke"]] : [],
      empty: "no interval between slips",
    });
    this.drawSequence();
  }

  /** Lines at whole numbers of periods, if they are far enough apart to be seen. */
  multiples(period, bins, width, y) {
    if (!bins.length) return [];
    const [low, high] = [bins[0] * width, (bins[bins.length - 1] + 1) * width];
    if ((high - low) / period > 60) return [];
    const lines = [];
    for (let n = Math.max(1, Math.ceil(low / period)); n * period <= high; n++) {
      lines.push({
        type: "line",
        x: [n * period, n * period],
        y: [0, Math.max(...y) * 1.04],
        colour: cssColour("muted"),
        width: 1,
        dash: [2, 3],
      });
    }
    return lines;
  }

  drawSequence() {
    const { report } = this;
    const { selected } = this.explorer;
    const name = report.isModulated ? "phase" : "interval";
    const slips = [...report.slipSet.keys()].filter((slip) => report.slipSet[slip] === selected);
    const [x, y] = ["onset", name].map((column) => scaled(report.slip.get(column)));
    const shades = ink(CATEGORIES);
    const jobs = [...new Set(slips.map((slip) => report.slipJob[slip]))];
    const group = Uint8Array.from(slips, (slip) => jobs.indexOf(report.slipJob[slip]) % shades.length);
    const tip = (k) => this.explorer.slipTip(slips[k]);
    const seeds = jobs.slice(0, shades.length).map((job, k) => [shades[k], `seed ${report.slips.jobs[job][1]}`]);
    this.sequence.show({
      x: { label: short(report.slip.get("onset")) },
      y: { label: short(report.slip.get(name)) },
      layers: [{ type: "points", x: slips.map((slip) => x[slip]), y: slips.map((slip) => y[slip]), group, colours: shades, size: 3.5, tip }],
      key: jobs.length > shades.length ? [["transparent", `${jobs.length} seeds`]] : seeds,
      empty: selected < 0 ? "select a set: click a point, or a row of the table" : "the set has no slips here",
    });
    this.facts();
  }

  facts() {
    const { report } = this;
    const { selected } = this.explorer;
    const place = element("set-facts");
    document.querySelector("nav a[href='#set']").textContent = `Selected ${selected < 0 ? "set" : report.name(selected)}`;
    if (selected < 0) {
      place.replaceChildren(make("p", {}, "None is selected. Click a point of a chart, or a row of the table."));
      return;
    }
    const names = [
      ...report.swept.map(({ name }) => name),
      ...["regime", "jobs", "failed_jobs", "slips", "tau_mean", "tau_mean_bound", "drop_mean", "mean_friction"],
      ...(report.isModulated ? ["eta", "locking_index", "has_phase", "phase_mean", "resultant_length"] : []),
      ...["locking_index_drive", "locking_index_excess", "resultant_drive", "resultant_excess"],
    ];
    const offered = report.offered.filter(({ name }) => names.includes(name));
    const facts = offered.map(({ name, label }) => [label, report.estimate(name, selected)]);
    const half = Math.ceil(facts.length / 2);
    const list = (pairs) =>
      make("dl", {}, ...pairs.flatMap(([term, words]) => [make("dt", {}, term), make("dd", {}, words)]));
    const seeds = report.seeds(selected);
    const code = make("code", { class: "command" });
    const input = make("input", { type: "number", min: "0", step: "1", value: seeds[0] ?? 0, list: "seeds" });
    const show = () => (code.textContent = report.command(selected, input.value || 0));
    input.addEventListener("input", show);
    show();
    place.replaceChildren(
      make(
        "p",
        {},
        make("strong", {}, "Set "),
        make("code", {}, report.setIds[selected]),
        " ",
        make("button", { type: "button", onclick: () => this.explorer.select(-1) }, "Deselect"),
      ),
      make("div", { class: "facts" }, list(facts.slice(0, half)), list(facts.slice(half))),
      make("label", {}, "One of its jobs alone, with seed ", input),
      make("datalist", { id: "seeds" }, ...seeds.map((seed) => make("option", { value: seed }))),
      code,
      make(
        "p",
        { class: "hint" },
        "A sweep records no traces. With --plot trace.png this command draws the shear force over time; with --trace trace.parquet it writes it.",
      ),
    );
  }
}
