// Puts the page together, follows the reader's input, and loads the page again during a run.

/** Reloads without a newer page after which it waits for the reader. */
const PATIENCE = 8;
/** Time without a touch of the page after which it may be loaded again, in ms. */
const QUIET = 4000;

function follow(report) {
  const live = element("live");
  const { status } = report;
  const total = status.jobs_done + status.jobs_failed + status.jobs_missing;
  if (!report.live) {
    live.hidden = status.jobs_missing === 0;
    const missing = `${counted(status.jobs_missing, "job")} of ${many(total)}`;
    live.textContent = `${missing} were missing when this page was written; stickslip run resumes with them.`;
    return;
  }
  const { refresh, written } = report.live;
  const seen = notes.get("seen");
  const unchanged = seen?.written === written ? seen.unchanged + 1 : 0;
  notes.set("seen", { written, unchanged });
  const share = Math.floor((100 * (total - status.jobs_missing)) / total);
  const left = status.time_left === null ? "" : `, about ${duration(status.time_left)} left`;
  const when = new Date(1000 * written).toLocaleTimeString();
  const isStale = unchanged >= PATIENCE;
  live.hidden = false;
  const next = isStale ? "It has not changed for some time: reload it by hand." : "The page reloads by itself.";
  live.textContent = `Running: ${share} % of ${counted(total, "job")}${left}. Written at ${when}. ${next}`;
  if (isStale) return;
  let touched = 0;
  for (const kind of ["pointermove", "pointerdown", "keydown", "wheel", "touchstart"]) {
    addEventListener(kind, () => (touched = Date.now()), { passive: true });
  }
  const reload = () => {
    if (document.hidden || Date.now() - touched < QUIET) setTimeout(reload, 1000);
    else location.reload();
  };
  // A little after the next one is due, and ever more rarely if none comes.
  setTimeout(reload, 1000 * (refresh + 1) * Math.min(8, 2 ** Math.max(0, unchanged - 2)));
}

async function start() {
  readState();
  const report = await unpack();
  document.querySelector("main").hidden = document.querySelector("nav").hidden = false;
  const filter = element("filter");
  const select = (set) => {
    keep({ set: set < 0 ? "" : report.setIds[set] });
    explorer.selected = set;
    explorer.draw();
    table.mark();
  };
  const explorer = new Explorer(report, select);
  const table = new SetTable(report, select);
  const apply = () => {
    const { shown, problem } = filtered(report);
    const left = shown.reduce((sum, isShown) => sum + isShown, 0);
    const hint =
      "A condition as of stickslip show --where, in SI units, such as V0 > 1e-5 and (R > 0.5 or tau_sd / tau_mean < 0.1). Names are those of columns, or headings of the table.";
    const isFiltered = state.filter.trim() || state.kind;
    const fitting = `${counted(left, "set")} of ${many(report.setCount)} fit.`;
    element("filter-note").textContent = problem ? `The filter does not apply: ${problem}.` : isFiltered ? fitting : hint;
    element("filter-note").classList.toggle("bad", problem !== "");
    filter.setAttribute("aria-invalid", String(problem !== ""));
    table.draw(shown);
    explorer.filter(shown);
  };
  const kind = element("kind");
  const choose = () => {
    keep({ filter: filter.value, kind: kind.value, page: "0" });
    apply();
  };
  [filter.value, kind.value] = [state.filter, state.kind];
  element("tools").addEventListener("input", choose);
  element("tools").addEventListener("submit", (event) => event.preventDefault());
  element("clear").addEventListener("click", () => {
    filter.value = kind.value = "";
    choose();
  });
  document.querySelector("nav").addEventListener("click", (event) => {
    const link = event.target.closest("a");
    if (!link) return;
    // The fragment holds what the reader has chosen.
    event.preventDefault();
    element(link.hash.slice(1)).scrollIntoView();
  });
  writeSamples(report);
  writeSweep(report);
  writeFailures(report);
  writeFigures(report);
  writeProvenance(report);
  const redraw = () => {
    writeRegimes(report);
    writeCost(report);
    explorer.draw();
  };
  explorer.selected = report.placeOf.get(state.set) ?? -1;
  writeRegimes(report);
  writeCost(report);
  apply();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  const print = (isPrinting) => {
    document.documentElement.classList.toggle("printing", isPrinting);
    redraw();
    charts.forEach((chart) => chart.paint());
  };
  addEventListener("beforeprint", () => print(true));
  addEventListener("afterprint", () => print(false));
  const scroll = notes.get("scroll");
  if (scroll && performance.getEntriesByType("navigation")[0]?.type === "reload") scrollTo(0, scroll);
  addEventListener("pagehide", () => notes.set("scroll", scrollY));
  follow(report);
  // Once the charts are drawn.
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  document.documentElement.dataset.ready = "yes";
}

/** Says what of large tables is shown. */
function writeSamples(report) {
  const { slips, sets_every: sets, census, setCount } = report;
  const samples = [];
  if (sets > 1) {
    samples.push(`The page has one in ${sets} of ${counted(census.sets, "set")}, ${many(setCount)} in all.`);
  }
  if (slips.every > 1) {
    samples.push(`The charts have one in ${slips.every} slips of these sets, ${many(slips.job.length)} in all.`);
    samples.push("Histograms and statistics count every slip.");
  }
  element("sample-note").textContent = samples.join(" ");
  element("sample-note").hidden = samples.length === 0;
}

history.scrollRestoration = "manual";
start().catch((error) => {
  const problem = element("problem");
  problem.hidden = false;
  problem.textContent = `The page cannot be shown: ${error.message}. It needs a browser of 2023 or later.`;
  throw error;
});
