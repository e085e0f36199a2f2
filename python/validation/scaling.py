"""What a slip costs as the slider grows: ``python -m validation.scaling [--quick]``. docs/numerics.md has the powers.

Every size breaks about as many contacts: the larger the slider, the fewer its slips. The start-up is also run alone and
its cost subtracted. Times are CPU times of one thread. Powers are slopes of straight lines through the logarithms.
"""

import argparse
import time

import numpy
import pandas

import stickslip

SOLVERS = {
    "grid 1e-3": {"tolerance": 1e-3, "resolve": "grid"},
    "Taylor 1e-6": {"tolerance": 1e-6, "resolve": "taylor"},
    "Taylor 1e-10": {"tolerance": 1e-10, "resolve": "taylor"},
}
#: Slips of start-up, whose cost is subtracted.
START_UP = 2


def per_slip(contacts: int, **keys: float | str) -> pandas.Series:
    """Costs and counts per slip past start-up of a slider; its slips have this many contacts together, and are two at least."""
    slips = max(contacts // (keys["N"] * keys["Ns"]), 2)

    def total(slips: int) -> numpy.ndarray:
        begin = time.process_time()
        job = stickslip.simulate(slips=slips, discard=0, **keys).job
        return numpy.array([time.process_time() - begin, job["simulated_time"], job["steps"], job["breaks"]])

    cpu, simulated, steps, breaks = (total(START_UP + slips) - total(START_UP)) / slips
    return pandas.Series(
        {"breaks": breaks, "steps": steps, "CPU s per step": cpu / steps, "CPU s": cpu, "CPU s per s": cpu / simulated}
    )


def main() -> None:
    """Prints a table for each size that grows and each solver, with the powers that fit best."""
    parser = argparse.ArgumentParser(prog="python -m validation.scaling", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer sizes and slips")
    contacts, sizes = (30_000, 3) if parser.parse_args().quick else (400_000, 5)
    for size, values in {"N": [70, 140, 280, 560, 1120][:sizes], "Ns": [20, 80, 320][: sizes - 1]}.items():
        for name, solver in SOLVERS.items():
            rows = {value: per_slip(contacts, **{"N": 70, "Ns": 20, size: value}, **solver) for value in values}
            table = pandas.DataFrame(rows).T
            powers = numpy.polyfit(numpy.log(table.index), numpy.log(table), 1)[0]
            table.loc["power"] = powers
            print(f"\n{name}, per slip against {size}\n{table.to_string(float_format='{:.3g}'.format)}")


if __name__ == "__main__":
    main()
