"""Makes the synthetic experiment of docs/measured.md, as a laboratory would write it down: slips of another slider, timed
with noise, in ms and mN, and no word of what the slider is made of.

    .venv/bin/python python/examples/experiment.py experiment.csv
"""

import csv
import random
import sys

import stickslip

#: What differs from the paper's slider.
SLIDER = {"Kd": 3e7, "tau_r": 0.004, "dfs": 0.03}
FREQUENCIES = (10, 20, 29, 41, 58, 82)
#: Standard deviation of times, in s, and runs of each frequency.
NOISE, RUNS = 2e-4, 2


def rows():
    """A row for each slip, run by run: first without modulation, then at rising frequency."""
    noise = random.Random(1)
    drives = [{} for _ in range(4)] + [{"Delta": 6e-7, "frequency": f} for f in FREQUENCIES for _ in range(RUNS)]
    for run, drive in enumerate(drives, 1):
        slips = stickslip.simulate(**SLIDER, **drive, seed=1000 + run, slips=60).slips().to_pandas()
        for onset, drop in zip(slips["onset"], slips["drop"], strict=True):
            time = 1e3 * (onset + noise.gauss(0, NOISE))
            amplitude = 1e6 * drive.get("Delta", 0)
            yield run, f"{time:.2f}", f"{1e3 * drop:.0f}", f"{amplitude:g}", drive.get("frequency", "")


if __name__ == "__main__":
    with open(sys.argv[1], "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["run", "t (ms)", "drop (mN)", "amplitude (um)", "frequency (Hz)"])
        table.writerows(rows())
