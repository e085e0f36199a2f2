"""A headless Chromium that shows one page, with a pointer, a keyboard and windows of any size."""

import time

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
)
# Seconds: other processes may keep the machine busy.
LONGEST = 60


class Browser:
    def __init__(self, profile):
        options = webdriver.ChromeOptions()
        options.binary_location = "/usr/bin/chromium"
        for flag in [*FLAGS.split(), f"--user-data-dir={profile}"]:
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
        self.window(1280, 900)

    def window(self, width, height, *, is_dark=False):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if is_dark else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})

    def open(self, path, fragment=""):
        """Opens a page, and returns the seconds until it can be used."""
        # Another fragment alone would load nothing.
        self.driver.get("about:blank")
        begin = time.monotonic()
        self.driver.get(path.as_uri() + fragment)
        self.wait("document.documentElement.dataset.ready === 'yes'")
        return time.monotonic() - begin

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def wait(self, condition):
        begin = time.monotonic()
        while not self.run(f"return Boolean({condition})"):
            assert time.monotonic() < begin + LONGEST, f"{condition}\n{self.errors()}"
            time.sleep(0.02)

    def settle(self):
        """Waits until the charts are drawn."""
        self.driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")

    def find(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector):
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def text(self, selector):
        return self.run("return document.querySelector(arguments[0]).innerText", selector)

    def type(self, selector, text):
        field = self.find(selector)
        field.clear()
        field.send_keys(text)

    def point_of(self, chart, number):
        """Where the point of this number of a chart's first layer with points is in the window, once it is in sight."""
        self.settle()
        return self.run(
            """const chart = charts.find(({ name }) => name === arguments[0]);
            chart.plot.scrollIntoView({ block: "center" });
            const { at, up } = chart.places[0];
            const box = chart.over.getBoundingClientRect();
            return [box.left + at[arguments[1]], box.top + up[arguments[1]]];""",
            chart,
            number,
        )

    def hover(self, place):
        actions = ActionChains(self.driver)
        actions.w3c_actions.pointer_action.move_to_location(*map(round, place))
        actions.perform()

    def click(self):
        actions = ActionChains(self.driver)
        actions.w3c_actions.pointer_action.click()
        actions.perform()

    def drag(self, start, end):
        actions = ActionChains(self.driver)
        pointer = actions.w3c_actions.pointer_action
        pointer.move_to_location(*map(round, start))
        pointer.pointer_down()
        pointer.move_to_location(*map(round, end))
        pointer.pointer_up()
        actions.perform()

    def errors(self):
        """What the console holds since the last look."""
        return self.driver.get_log("browser")

    def picture(self, path):
        self.driver.save_screenshot(str(path))
