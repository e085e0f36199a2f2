// Sections that do not change: what was swept, regimes, failures, cost, provenance.

const rows = (head, body) => [
  make("thead", {}, make("tr", {}, ...head.map((words) => make("th", { scope: "col" }, words)))),
  make("tbody", {}, ...body.map((cells) => make("tr", {}, ...cells.map((words) => make("td", {}, words))))),
];

function writeSweep(report) {
  const { status, census } = report;
  element("title").textContent = status.name;
  document.title = `${status.name} – stickslip report`;
  const failed = status.jobs_failed ? `, ${many(status.jobs_failed)} failed` : "";
  const missing = status.jobs_missing ? `, ${many(status.jobs_missing)} missing` : "";
  const done = `${counted(census.sets, "parameter set")}, ${counted(status.jobs_done, "job")} done${failed}${missing}`;
  const share = -100 * census.tau_off;
  const most = share < 0.1 ? "less than 0.1" : `up to about ${share.toFixed(1)}`;
  const off = census.tau_off === null ? "" : `, by ${most} %`;
  const cut = census.jobs_cut
    ? ` ${counted(census.jobs_cut, "job")} ended within an interval: mean intervals are too short${off}.`
    : "";
  element("summary").textContent = `Report of stickslip: ${done}, ${counted(census.slips, "slip")}.${cut}`;
  const axis = new Map(report.axes.flatMap(([keys, count]) => keys.split(", ").map((key) => [key, count])));
  const named = ({ name, symbol }) => (symbol === name ? name : `${symbol} (${name})`);
  const swept = report.swept.map((column) => {
    const distinct = [...new Set(column.values)].filter((value) => value !== null);
    if (isNumeric(column)) distinct.sort((a, b) => a - b);
    const words = distinct.map((value) => shownValue(column, column.values.indexOf(value)));
    const range = words.length <= 6 ? words.join(", ") : `${words[0]} to ${words[words.length - 1]}`;
    return [named(column), column.meaning, many(distinct.length), range, column.unit];
  });
  const derived = [...axis].filter(([key]) => !report.swept.some(({ name }) => name === key));
  const others = derived.map(([key, count]) => [
    key,
    key === "seed" ? "realisations of the disorder" : "fixes the period T",
    many(count),
    "",
    "",
  ]);
  element("swept").replaceChildren(...rows(["Parameter", "Meaning", "Values", "Range", "Unit"], [...swept, ...others]));
  const fixed = report.fixed.map((column) => [named(column), column.meaning, shownValue(column, 0, 6), column.unit]);
  element("fixed").replaceChildren(...rows(["Parameter", "Meaning", "Value", "Unit"], fixed));
  const last = report.sweeps.length - 1;
  element("sweep-files").replaceChildren(
    ...report.sweeps.flatMap((text, k) =>
      [
        last > 0 ? make("h3", {}, k === last ? "The last sweep" : `Sweep ${k + 1}, extended since`) : null,
        make("pre", { tabindex: "0" }, text),
      ].filter(Boolean),
    ),
  );
}

/** How many sets are in which regime. */
function writeRegimes(report) {
  const { regimes } = report.census;
  const given = Object.entries(regimes).filter(([, count]) => count > 0);
  const order = [...REGIMES, ""];
  given.sort(([a], [b]) => order.indexOf(a) - order.indexOf(b));
  const bar = make("div", { class: "share", "aria-hidden": "true" });
  const words = given.map(([regime, count]) => {
    const part = make("span");
    part.style.flex = `${count} 0 0`;
    part.style.background = regime ? ink(CATEGORIES)[REGIMES.indexOf(regime)] : ink(PALE);
    bar.append(part);
    const swatch = make("span", { class: "swatch" });
    swatch.style.background = part.style.background;
    return make("li", {}, swatch, `${regime || "without a finished job"}: ${counted(count, "set")}`);
  });
  if (report.isModulated) {
    const phased = report.values("has_phase").filter(Boolean);
    words.push(make("li", {}, `with a phase: ${counted(phased.length, "set")} of ${many(report.setCount)}`));
  }
  element("regimes").replaceChildren(make("h3", {}, "Regimes"), bar, make("ul", { class: "legend" }, ...words));
}

function writeFailures(report) {
  const { jobs_failed: failed, failures } = report.status;
  element("failures").hidden = failed === 0;
  document.querySelector("nav a[href='#failures']").hidden = failed === 0;
  const rest =
    failed > failures.length
      ? ` The first ${failures.length} are here; all are in tables/jobs, with outcome and reason.`
      : "";
  element("failures-note").textContent =
    `${counted(failed, "job")} failed.${rest} Each command runs one of them alone; run --retry-failed runs all of them again.`;
  element("failures-list").replaceChildren(
    ...failures.map(({ job_id: id, reason, command }) =>
      make(
        "li",
        {},
        make("span", { class: "bad" }, reason),
        " ",
        make("small", {}, `job ${id}`),
        make("code", { class: "command" }, command),
      ),
    ),
  );
}

function writeCost(report) {
  const { jobs, parts, predicted, measured, shown } = report.cost;
  const chart = (report.costChart ??= new Chart(element("cost-chart"), "CPU time of parts"));
  const ratio = measured / predicted;
  const left = report.status.time_left;
  const rest =
    report.status.jobs_missing && left !== null
      ? ` What is missing takes about ${duration(left)} of wall time at the pace so far.`
      : "";
  const took = `took ${duration(measured)} of CPU time, ${number(ratio, 3)} times the predicted ${duration(predicted)}`;
  element("cost-note").textContent = jobs
    ? `${counted(jobs, "job")} in ${counted(parts, "part")} ${took}.${rest}`
    : "No log has the cost of a part: the tables were merged or copied from elsewhere.";
  const [x, y] = [2, 3].map((k) => shown.map((part) => part[k]));
  const both = [...x, ...y].filter((value) => value > 0);
  const ends = [both.reduce((a, b) => Math.min(a, b), 1e3) / 10, both.reduce((a, b) => Math.max(a, b), 1e-6) * 10];
  const tip = (k) => [
    make("strong", {}, shown[k][0]),
    `${counted(shown[k][1], "job")}: predicted ${duration(x[k])}, measured ${duration(y[k])}, ratio ${number(y[k] / x[k], 3)}`,
  ];
  chart.show({
    x: { label: "predicted CPU time (s)", log: true },
    y: { label: "measured CPU time (s)", log: true },
    layers: [
      { type: "line", x: ends, y: ends, colour: cssColour("muted"), dash: [5, 4] },
      { type: "points", x, y, colours: [ink(CATEGORIES)[0]], size: 3.5, alpha: 0.8, tip },
    ],
    key: [[cssColour("muted"), "dashed: as predicted", "stroke"]],
    isSquare: true,
    empty: "no logs of parts",
  });
}

/** The standing figures, with ids of their own, and a button that saves each. */
function writeFigures(report) {
  element("figures").hidden = report.figures.length === 0;
  document.querySelector("nav a[href='#figures']").hidden = report.figures.length === 0;
  const shown = report.figures.map(([name, text]) => {
    const parsed = new DOMParser().parseFromString(text.replaceAll("frame-", `${name}-frame-`), "image/svg+xml");
    const svg = document.importNode(parsed.documentElement, true);
    // With its size alone it would be cut where there is little room.
    const sides = ["width", "height"].map((side) => Number.parseFloat(svg.getAttribute(side)));
    if (!svg.hasAttribute("viewBox")) svg.setAttribute("viewBox", `0 0 ${sides.join(" ")}`);
    const file = new Blob([text], { type: "image/svg+xml" });
    const button = make("button", { type: "button", onclick: () => save(`${name}.svg`, file) }, "Save as SVG");
    return make("figure", {}, make("figcaption", {}, make("strong", {}, name), " ", button), svg);
  });
  element("figure-list").replaceChildren(...shown);
}

function writeProvenance(report) {
  const versions = [
    ["program", report.program],
    ["model version", report.model_version],
    ["random numbers", report.rng_scheme],
    ["plan version", report.plan_version],
    ["directory", report.directory],
    ["parts", `${report.status.parts_done} done, ${report.status.parts_missing} missing`],
  ];
  element("versions").replaceChildren(
    ...versions.flatMap(([term, words]) => [make("dt", {}, term), make("dd", {}, String(words))]),
  );
  const runs = report.runs.map(({ program, host, threads, jobs, ended }) => [
    program,
    host,
    String(threads),
    many(jobs),
    ended ? `${counted(ended[0], "job")} in ${duration(ended[1])}` : "at work, or killed",
  ]);
  element("runs").replaceChildren(...rows(["Run by", "Host", "Threads", "Jobs to run", "Ran"], runs));
}
