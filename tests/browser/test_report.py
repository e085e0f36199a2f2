"""The page of a report, in a browser: what is seen, pointed at, selected, filtered and sorted."""

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
    assert cells and cells == pytest.approx([share for share in alone if share is not None], rel=1e-4)
    browser.find("#sets-table tbody button").click()
    browser.wait("state.set !== ''")
    assert "resultant length by the drive alone" in browser.text("#set-facts")
    browser.type("#filter", "has_phase=true")
    assert 0 < len(rows(browser)) <= SETS


def test_selecting_a_point_shows_the_set_its_intervals_and_its_phases(browser, report):
    browser.open(report(MODULATED))
    before = ink(browser, "sequence")
    browser.hover(browser.point_of("phi-eta", 77))
    browser.click()
    browser.wait("state.set !== ''")
    facts = browser.text("#set-facts")
    chosen = browser.run("return state.set")
    assert chosen in facts and "mean interval" in facts and "--set seed=0" in facts
    assert "of 20" in browser.run("return charts.find(({ name }) => name === 'histogram').content.y.label")
    assert ink(browser, "sequence") > before
    assert browser.find("#sets-table tr[aria-selected=true] button").text == chosen[:8]
    assert f"set={chosen}" in browser.driver.current_url


def test_a_row_of_the_table_is_selected_by_the_keyboard(browser, report):
    browser.open(report(MODULATED))
    browser.find("#sets-table tbody button").send_keys(Keys.ARROW_DOWN)
    browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
    browser.wait("state.set !== ''")
    assert browser.run("return state.set").startswith(browser.all("#sets-table tbody button")[1].text)


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


def test_the_filter_keeps_the_sets_that_fulfil_all_conditions(browser, report):
    browser.open(report(MODULATED))
    browser.type("#filter", "Delta = 1e-6  V0<1.5e-4")
    assert len(rows(browser)) == 6 and set(column(browser, "Delta")) == {"1"}
    assert "6 sets of 18" in browser.text("#filter-note")
    browser.settle()
    shown = browser.run("const { places } = charts.find(({ name }) => name === 'free'); return places[0].at.filter((x) => x > 0).length")
    assert shown == 6
    browser.type("#filter", "nonsense>3")
    assert "no column nonsense" in browser.text("#filter-note") and len(rows(browser)) == SETS
    browser.find("#clear").click()
    assert browser.text("#filter-note").startswith("Examples")


def test_a_column_sorts_up_and_down_and_back(browser, report):
    browser.open(report(MODULATED))
    before = column(browser, "tau_mean")
    sort = "#sets-table th[data-column=tau_mean] button"
    values = sorted(map(float, before))
    for expected in (values, values[::-1], None):
        browser.find(sort).click()
        found = column(browser, "tau_mean")
        assert (found == before) if expected is None else (list(map(float, found)) == expected)
    assert browser.run("return document.activeElement.innerText") == "⟨τ⟩"


def test_columns_can_be_shown_and_hidden(browser, report):
    browser.open(report(MODULATED))
    browser.find("#pick-columns summary").click()
    labels = {label.text: label for label in browser.all("#column-list label")}
    labels["95 % quantile of the intervals τ(95 %) (ms)"].click()
    labels["Slips of all seeds"].click()
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
    browser.type("#filter", "V0>6e-5")
    browser.find("#sets-table tbody button").click()
    browser.find("#sets-table th[data-column=tau_mean] button").click()
    browser.run("scrollTo(0, 900)")
    chosen = browser.run("return { ...state, top: scrollY }")
    browser.driver.refresh()
    browser.wait("document.documentElement.dataset.ready === 'yes'")
    assert browser.run("return { ...state, top: scrollY }") == chosen
    assert browser.find("#filter").get_property("value") == "V0>6e-5"
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
