"""The page of a report, in a browser: what is seen, pointed at, selected, filtered and sorted."""

import json
import re
import shutil
import subprocess
import time

import pytest
from conftest import FAILING, LARGE, MODULATED
from selenium.webdriver.common.keys import Keys

# Bytes that a page may have.
LARGEST = 6e6
# Seconds in which a page with 100,000 slips can be used. It takes 1.5 on an idle core; other processes may be at work.
SLOWEST = 10

SETS = 18


def rows(browser):
    return browser.all("#sets-table tbody tr")


def column(browser, name):
    """The cells of a column of the table of sets."""
    script = """const heads = [...document.querySelectorAll("#sets-table thead th")];
    const place = heads.findIndex((head) => head.dataset.column === arguments[0]);
    return [...document.querySelectorAll("#sets-table tbody tr")].map((row) => row.children[place].innerText);"""
    return browser.run(script, name)


def ink(browser, chart):
    """How many pixels of a chart are drawn."""
    script = """const { base } = charts.find(({ name }) => name === arguments[0]);
    const copy = Object.assign(document.createElement("canvas"), { width: base.width, height: base.height });
    const ctx = copy.getContext("2d", { willReadFrequently: true });
    ctx.drawImage(base, 0, 0);
    const { data } = ctx.getImageData(0, 0, base.width, base.height);
    let drawn = 0;
    for (let k = 3; k < data.length; k += 4) drawn += data[k] > 0;
    return drawn;"""
    browser.settle()
    return browser.run(script, chart)


def test_a_sweep_under_modulation_has_all_its_charts(browser, report):
    browser.open(report(MODULATED))
    assert browser.text("#title") == "modulated"
    assert "18 parameter sets, 36 jobs done, 360 slips" in browser.text("#summary")
    assert [cell.text for cell in browser.all("#swept tbody td:first-child")][:2] == ["V₀ (V0)", "Δ (Delta)"]
    for chart in ("phi-eta", "tau-T", "free", "histogram", "cost-chart"):
        assert ink(browser, chart) > 2000, chart
    assert len(rows(browser)) == SETS
    assert "stickslip 0" in browser.text("#versions")


def test_an_axis_of_few_values_has_its_ticks_there(browser, report):
    browser.open(report(MODULATED))
    labels = "return new Axis({ label: '', low: 20, high: 130, few: fewOf(%s) }).ticks(8).map(([, label]) => label)"
    assert browser.run(labels % "[29, 58, 116, 58, null]") == ["29", "58", "116"]
    assert browser.run(labels % "[29, 58, 116]") == ["20", "40", "60", "80", "100", "120"]


def test_the_page_opens_with_the_result_and_its_table_and_shows_the_figures(browser, report):
    browser.open(report(MODULATED))
    assert [section.get_property("id") for section in browser.all("main > section")][:4] == ["explore", "sets", "slips", "figures"]
    content = "const { content } = charts.find(({ name }) => name === 'free'); return "
    assert browser.run(content + "[content.x.label, content.y.label]") == ["Drive velocity V₀ (m/s)", "Mean interval ⟨τ⟩ (ms)"]
    # A line of three velocities for each frequency and amplitude.
    lengths = browser.run(content + "content.layers.filter(({ type }) => type === 'line').map(({ x }) => x.length)")
    assert lengths == [3] * 6
    names = [name.text for name in browser.all("#figure-list figcaption strong")]
    drawn = {file.stem for file in (report(MODULATED).parent / "figures").glob("*.svg")}
    assert {"overview", "phi-eta", "tau-T"} <= drawn and set(names) == drawn
    assert len(names) == len(browser.all("#figure-list svg")) == len(drawn)
    assert [button.text for button in browser.all("#figure-list button")] == ["Save as SVG"] * len(names)
    saved = """const blobs = []; const known = URL.createObjectURL;
    URL.createObjectURL = (blob) => { blobs.push(blob); return known(blob); };
    element("save-table").click(); URL.createObjectURL = known;
    window.saved = null; blobs[0].text().then((text) => (window.saved = text));"""
    browser.run(saved)
    browser.wait("window.saved")
    lines = browser.run("return window.saved").splitlines()
    assert len(lines) == 1 + SETS and lines[0].startswith("set_id,V0,Delta") and "tau_mean" in lines[0]


def test_hostile_texts_are_shown_as_they_are(browser, report):
    browser.open(report(MODULATED))
    browser.find("#sweep details:last-of-type summary").click()
    assert "</script><script>document.title='taken'</script><img" in browser.text("#sweep-files")
    assert browser.driver.title == "modulated – stickslip report"
    assert not browser.all("img")


def test_pointing_at_a_slip_names_its_job_and_the_command_that_runs_it(browser, report, program):
    browser.open(report(MODULATED))
    browser.hover(browser.point_of("phi-eta", 77))
    browser.wait("!element('tip').hidden")
    tip = browser.text("#tip")
    seed = re.search(r"set [0-9a-f]{8}, seed (\d), slip \d", tip)[1]
    command = browser.text("#tip code")
    assert command.startswith("stickslip simulate --set ") and f"--set seed={seed} --slips 10" in command
    done = subprocess.run([program, *command.split()[1:]], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    browser.hover((5, 5))
    browser.wait("element('tip').hidden")


def test_what_the_drive_alone_explains_stands_beside_what_is_seen(browser, report):
    layers = "return charts.find(({ name }) => name === 'free').places.map(({ layer }) => layer.y)"
    browser.open(report(MODULATED), "#y=resultant_length")
    assert len(browser.run(layers)) == 1 and "drive alone" not in browser.text("#free figcaption")
    browser.open(report(MODULATED + "control = true\n"), "#y=resultant_length")
    # Controls are no sets.
    assert len(rows(browser)) == SETS and "18 parameter sets" in browser.text("#summary")
    alone, seen = browser.run(layers)
    assert len(alone) == len(seen) == SETS and alone != seen
    assert "by the drive alone" in browser.text("#free figcaption")
    # A slider without slips explains nothing.
    cells = [float(cell) for cell in column(browser, "resultant_drive") if cell != "–"]
    assert cells and cells == pytest.approx([share for share in alone if share is not None], abs=5e-4)
    rows(browser)[0].click()
    browser.wait("state.set !== ''")
    assert "Resultant length by the drive alone" in browser.text("#set-facts")
    browser.find("#kind").send_keys("with a phase")
    phased = browser.run("return element('regimes').innerText.match(/with a phase: (\\d+)/)[1]")
    assert f"{phased} sets of 18 fit" in browser.text("#filter-note") and len(rows(browser)) == int(phased)


def test_selecting_a_point_shows_the_set_its_intervals_and_its_phases(browser, report):
    browser.open(report(MODULATED))
    before = ink(browser, "sequence")
    browser.hover(browser.point_of("phi-eta", 77))
    browser.click()
    browser.wait("state.set !== ''")
    facts = browser.text("#set-facts")
    chosen = browser.run("return state.set")
    assert chosen in facts and "Mean interval" in facts and "--set seed=0" in facts
    assert "of 20" in browser.run("return charts.find(({ name }) => name === 'histogram').content.y.label")
    assert ink(browser, "sequence") > before
    assert browser.find("#sets-table tr[aria-selected=true] code").text == chosen[:8]
    assert f"set={chosen}" in browser.driver.current_url


def test_a_row_of_the_table_is_selected_by_the_keyboard(browser, report):
    browser.open(report(MODULATED))
    rows(browser)[0].send_keys(Keys.ARROW_DOWN)
    browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
    browser.wait("state.set !== ''")
    assert browser.run("return state.set").startswith(rows(browser)[1].text[:8])


def test_a_click_anywhere_on_a_row_selects_its_set_and_a_drag_its_text(browser, report):
    browser.open(report(MODULATED))
    cells = browser.all("#sets-table tbody tr:nth-child(3) td")
    browser.run("arguments[0].scrollIntoView({ block: 'center' })", cells[0])
    boxes = [browser.run("const { left, top, width, height } = arguments[0].getBoundingClientRect(); return [left, top, width, height]", cell) for cell in cells]
    (left, top, _, height), (right, *_) = boxes[1], boxes[4]
    browser.drag((left + 4, top + height / 2), (right, top + height / 2))
    assert browser.run("return [state.set, getSelection().isCollapsed]") == ["", False]
    cells[-1].click()
    assert browser.run("return state.set").startswith(cells[0].text)
    assert f"set {cells[0].text}" in browser.text("nav")


def test_the_arrow_keys_go_through_the_points_of_a_chart(browser, report):
    browser.open(report(MODULATED))
    browser.settle()
    canvas = browser.find("#free canvas:last-of-type")
    canvas.send_keys(Keys.ARROW_RIGHT)
    first = browser.text("#tip")
    canvas.send_keys(Keys.ARROW_RIGHT)
    assert browser.text("#tip") != first and first.startswith("set ")
    canvas.send_keys(Keys.ENTER)
    browser.wait("state.set !== ''")


def test_the_filter_keeps_the_sets_that_fulfil_the_condition(browser, report):
    browser.open(report(MODULATED))
    browser.type("#filter", "Delta == 1e-6 and V0 < 1.5e-4")
    assert len(rows(browser)) == 6 and set(column(browser, "Delta")) == {"1"}
    assert "6 sets of 18" in browser.text("#filter-note")
    browser.settle()
    shown = browser.run("const { places } = charts.find(({ name }) => name === 'free'); return places[0].at.filter((x) => x > 0).length")
    assert shown == 6
    browser.find("#clear").click()
    assert "show --where" in browser.text("#filter-note") and len(rows(browser)) == SETS


CONDITIONS = """
V0 > 1e-4 | V0 == 1e-4 | V0==1.000000000004e-4 | V0 == 1.00000000001e-4 | V0 != 1e-4 | Delta >= 1e-6 and frequency < 100
V0 < 6e-5 or V0 > 1.5e-4 and Delta < 7e-7 | (V0 < 6e-5 or V0 > 1.5e-4) and Delta < 7e-7 | 1/T == 29 | -T < -.02
eta * V0 * T == 6.28318530717959 * Delta | R > 0.9 | ⟨τ⟩ < 0.01 | V₀ <= 1E-4 | σ(τ) > 1 | tau_sd / tau_mean > 0.5 | tau_mean_high - tau_mean_low < 2 * tau_sd
sqrt(V0) > 1e-2 | sqrt ( V0*V0 ) * 2 > 2e-4 | sqrt(-1) < 1 | sqrt V0 > 1 | sqrt(V0 > 1) > 1 | sqrt
(tau_mean - 5e-3) * 2 > 1e-3 | 1 - 2 - 3 == -4 | 8 / 2 / 2 == 2 | 1 + 2 * 3 == 7 | - - 1 == 1 | T_to > 0 | T_to != 1
locking_index > 0.5 | resultant_excess > 0 | 0 / 0 != 1 | 1 / 0 > 5 | 1 / 0 == -1 / 0 | slips >= 20 | slip_share < 0.95
τ < 1 | τ⟩ < 1 | tau < 1 | tau_ < 1 | tau_men > 1 | v0 > 1 | delta < 1 | resultant > 0 | k > 0 | stress_drop > 1 | qqqqqq > 1
constructor > 1 | regime > 1 | has_phase == 1 | set_id == 1 | V0 | V0 > | > 1 | V0 = 1 | V0 => 1 | V0 ! 1 | 1 < V0 < 2 | (V0 > 1
V0 > 1) | V0 > 1 V0 > 2 | V0 > 1, V0 > 2 | (V0 > 1) + 1 > 2 | -(V0 > 1) < 2 | V0 > 1 and 3 | V0 & 1 | V0 > 1e999 | V0 > 1e
V0 > 1.2.3 | V0 > 0x10 | V0 > 1e-4x | V0 > 1_000 | V0 > . | 𝒱 > 1 | 𝒱 + § > 1 | "V0" > 1 | not V0 > 1 | V0 > 1 && T > 1 | ()
"""


@pytest.mark.parametrize("sweep", [MODULATED, MODULATED + "control = true\n"], ids=["", "controls"])
def test_the_filter_speaks_the_language_of_the_command_line(browser, report, program, sweep):
    page = report(sweep)
    browser.open(page)
    conditions = [text.strip() for text in re.split(r" \| |\n", CONDITIONS.strip())]
    nested = ["(" * depth + "V0 > 0" + ")" * depth for depth in (248, 600)]
    held = set()
    for text in [*conditions, *nested, f"  {conditions[0]} "]:
        show = [program, "show", page.parent, f"--where={text}", "--columns", "set_id", "--json"]
        done = subprocess.run(show, capture_output=True, text=True, timeout=60)
        browser.run("element('filter').value = arguments[0]; element('filter').dispatchEvent(new Event('input', { bubbles: true }))", text)
        note, ids = browser.text("#filter-note"), [cell.text for cell in browser.all("#sets-table tbody code")]
        if done.returncode == 0:
            expected = [row["set_id"][:8] for row in json.loads(done.stdout)["sets"]]
            assert ids == expected and f"{len(ids)} set" in note, text
            held.add(len(ids))
        else:
            problem = done.stderr.strip().partition(f"--where {text}: ")[2].removesuffix(" `stickslip plot --list` shows all")
            if problem.startswith("none of "):
                assert ids == [] and note.startswith(f"0 sets of {SETS} fit"), (text, note)
                held.add(0)
                continue
            assert problem and note.startswith(f"The filter does not apply: {problem}"), (text, note, done.stderr)
            assert len(ids) == SETS
    assert len(held) > 5


def test_the_table_has_the_columns_and_the_intervals_that_show_prints(browser, report, program):
    page = report(MODULATED + "control = true\n")
    browser.open(page)
    shown = subprocess.run([program, "show", page.parent], capture_output=True, text=True, timeout=60, check=True).stdout
    head, *lines = [re.split(r"  +", line.strip()) for line in shown.splitlines()[: 1 + SETS]]
    names = browser.run("return [...document.querySelectorAll('#sets-table th')].slice(1).map((head) => head.dataset.column)")
    labels = {name: browser.text(f"#sets-table th[data-column={name}]").split() for name in names}
    printed = {tuple(re.sub(r"[()]", " ", title).split()): cells for title, cells in zip(head, zip(*lines))}
    for name in names:
        key = tuple(re.sub(r"[()]", " ", " ".join(labels[name])).split())
        assert list(printed.pop(key)) == column(browser, name), name
    assert printed == {} and any("±" in cell for cell in column(browser, "tau_mean"))


def test_each_entry_of_a_menu_stands_by_itself(browser, report):
    for sweep, code in [(MODULATED + "control = true\n", 0), (FAILING, 1)]:
        browser.open(report(sweep, code), "#y=locking_index_drive")
        browser.run("document.getElementById('pick-columns').open = true")
        menus = [[option.text for option in menu.find_elements("tag name", "option")] for menu in browser.all("select")]
        menus.append([label.text for label in browser.all("#column-list label")])
        for entries in menus:
            assert len(entries) == len(set(entries))
            assert not [entry for entry in entries if re.search(r"(?i)the same|\b(upper|lower) end|turning point", entry)]
        assert "y: the same" not in browser.text("#free figcaption")
        assert "(µs)" not in "".join(browser.run("return [...document.querySelectorAll('#fixed tr')].map((row) => row.innerText)"))


@pytest.mark.parametrize("width", [500, 1400])
def test_every_control_lies_within_the_window(browser, report, width):
    browser.window(width, 900)
    browser.open(report(MODULATED))
    ends = "return [...document.querySelectorAll('nav a, select, input, button:not(#sets-table *)')].map((control) => control.getBoundingClientRect().right)"
    assert max(browser.run(ends)) <= width
    assert browser.run("return [...document.querySelectorAll('select')].every((menu) => menu.scrollWidth <= menu.clientWidth)")


def test_a_column_sorts_up_and_down_and_back(browser, report):
    browser.open(report(MODULATED))
    before = column(browser, "eta")
    sort = "#sets-table th[data-column=eta] button"
    values = sorted(map(float, before))
    for expected in (values, values[::-1], None):
        browser.find(sort).click()
        found = column(browser, "eta")
        assert (found == before) if expected is None else (list(map(float, found)) == expected)
    assert browser.run("return document.activeElement.innerText") == "η"


def test_columns_can_be_shown_and_hidden(browser, report):
    browser.open(report(MODULATED))
    browser.find("#pick-columns summary").click()
    labels = {label.text: label for label in browser.all("#column-list label")}
    labels["95 % quantile of the intervals τ(95 %) (ms) tau_95"].click()
    labels["Slips of all seeds slips"].click()
    assert len(column(browser, "tau_95")) == SETS
    assert not browser.all("#sets-table th[data-column=slips]")


def test_a_dragged_box_zooms_and_a_double_click_shows_all_again(browser, report):
    browser.open(report(MODULATED))
    x, y = browser.point_of("phi-eta", 77)
    browser.drag((x - 40, y - 40), (x + 40, y + 40))
    browser.wait("charts.find(({ name }) => name === 'phi-eta').view")
    assert browser.find("#phi-eta figcaption button").is_displayed()
    browser.find("#phi-eta figcaption button").click()
    browser.wait("!charts.find(({ name }) => name === 'phi-eta').view")


def test_what_was_chosen_survives_a_reload(browser, report):
    browser.open(report(MODULATED))
    browser.type("#filter", "V0 > 6e-5")
    rows(browser)[0].click()
    browser.find("#sets-table th[data-column=tau_mean] button").click()
    browser.run("scrollTo(0, 900)")
    chosen = browser.run("return { ...state, top: scrollY }")
    browser.driver.refresh()
    browser.wait("document.documentElement.dataset.ready === 'yes'")
    assert browser.run("return { ...state, top: scrollY }") == chosen
    assert browser.find("#filter").get_property("value") == "V0 > 6e-5"
    assert len(rows(browser)) == 12 and browser.all("#sets-table th[aria-sort=ascending]")


def test_failed_jobs_are_listed_with_their_commands(browser, report):
    browser.open(report(FAILING, code=1))
    items = [item.text for item in browser.all("#failures-list li")]
    assert len(items) == 2 and all("300 contact events" in item and "stickslip simulate --set N=30" in item for item in items)
    assert not browser.find("#phi-eta").is_displayed(), "there is no modulation"


@pytest.mark.parametrize("is_dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [380, 1280])
def test_the_page_fits_its_window_and_follows_the_colours(browser, report, tmp_path, width, is_dark):
    browser.window(width, 900, is_dark=is_dark)
    browser.open(report(MODULATED))
    assert browser.run("return document.documentElement.scrollWidth") <= width
    ground = browser.run("return getComputedStyle(document.body).backgroundColor")
    assert sum(map(int, re.findall(r"\d+", ground))) < 150 if is_dark else ground == "rgb(255, 255, 255)"
    browser.picture(tmp_path / "page.png")


def test_a_page_is_printed_in_light_colours(browser, report, tmp_path):
    browser.window(1280, 900, is_dark=True)
    browser.open(report(MODULATED))
    browser.run("dispatchEvent(new Event('beforeprint'))")
    assert browser.run("return getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    browser.run("dispatchEvent(new Event('afterprint'))")
    assert browser.run("return getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"


def test_a_page_with_a_hundred_thousand_slips_is_small_and_quick(browser, report):
    page = report(LARGE)
    seconds = browser.open(page)
    assert browser.run("return charts.find(({ name }) => name === 'phi-eta').places[0].at.length") == 100_000
    begin = time.monotonic()
    browser.hover(browser.point_of("phi-eta", 50_000))
    browser.wait("!element('tip').hidden")
    hover = time.monotonic() - begin
    begin = time.monotonic()
    browser.click()
    browser.wait("state.set !== ''")
    select = time.monotonic() - begin
    bytes_ = page.stat().st_size
    print(f"{bytes_ / 1e6:.2f} MB, shown after {seconds:.2f} s, hover {hover:.2f} s, selection {select:.2f} s")
    assert bytes_ < LARGEST and seconds < SLOWEST


def test_a_page_reloads_while_a_run_goes_on_and_stops_at_its_end(browser, program, tmp_path):
    sweep, results = tmp_path / "sweep.toml", tmp_path / "results"
    sweep.write_text(LARGE.replace("count = 2 }", "count = 400 }"))
    run = [program, "run", sweep, "--out", results, "--report", "--threads", "1"]
    child = subprocess.Popen(run, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        begin = time.monotonic()
        while not (results / "report.html").exists():
            assert child.poll() is None and time.monotonic() < begin + 60, "no report is written"
            time.sleep(0.05)
        browser.open(results / "report.html", "#filter=V0%3E6e-5")
        assert browser.text("#live").startswith("Running: ")
        browser.run("window.isFirst = true")
        browser.wait("!window.isFirst && document.documentElement.dataset.ready === 'yes'")
        assert browser.find("#filter").get_property("value") == "V0>6e-5"
    finally:
        child.terminate()
        child.wait()
    browser.wait("document.documentElement.dataset.ready === 'yes' && element('live').innerText.includes('were missing')")
    browser.run("window.isFirst = true")
    time.sleep(8)
    assert browser.run("return window.isFirst"), "it reloads no longer"


def test_the_page_works_anywhere_without_its_directory(browser, report, tmp_path):
    page = shutil.copy(report(MODULATED), tmp_path / "a page.html")
    browser.open(page)
    assert len(rows(browser)) == SETS
