"""The built program, a browser, and reports of small sweeps."""

import os
import subprocess
from pathlib import Path

import pytest
from browser import Browser

ROOT = Path(__file__).resolve().parents[2]

HOSTILE = "</script><script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">\u2028"

MODULATED = f"""# {HOSTILE}
name = "modulated"

[model]
N = 5
Ns = 4

[axes]
Delta     = [5e-7, 1e-6]
frequency = [29, 90, 300]
V0        = {{ log = [5e-5, 2e-4], points = 3 }}
seed      = {{ count = 2 }}

[record]
slips = 10
"""

FAILING = """
name = "failing"

[model]
Ns = 2

[axes]
N    = [1, 2, 30]
seed = { count = 2 }

[record]
slips = 2
discard = 0
max_events = 300
"""

# 100,000 slips of the cheapest kind.
LARGE = """
name = "large"

[model]
N  = 1
Ns = 1

[axes]
Delta     = [5e-7, 1e-6]
frequency = { log = [20, 400], points = 5 }
V0        = { log = [5e-5, 2e-4], points = 10 }
seed      = { count = 2 }

[record]
slips = 500
"""


@pytest.fixture(scope="session")
def program():
    target = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
    program = Path(os.environ.get("STICKSLIP", target / "release" / "stickslip")).resolve()
    if not program.exists():
        pytest.fail(f"{program} is missing: run cargo build --release, or set STICKSLIP to the program")
    return program


@pytest.fixture(scope="session")
def report(program, tmp_path_factory):
    """Runs a sweep, once; the path of its report."""
    folder, written = tmp_path_factory.mktemp("reports"), {}

    def write(sweep, code=0):
        if sweep not in written:
            number = len(written)
            (folder / "sweep.toml").write_text(sweep)
            results = folder / f"results-{number}"
            run = [program, "run", folder / "sweep.toml", "--out", results, "--report"]
            done = subprocess.run(run, capture_output=True, text=True, timeout=300)
            assert done.returncode == code, done.stderr
            written[sweep] = results / "report.html"
        return written[sweep]

    return write


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("profile"))
    yield browser
    browser.driver.quit()


@pytest.fixture(autouse=True)
def no_errors(browser):
    """A wide window before each test, and an empty console after it."""
    browser.window(1280, 900)
    yield
    assert browser.errors() == []
