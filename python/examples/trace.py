"""Makes the synthetic trace of docs/measured.md, as a laboratory would record it: a block on a spring that slips when the
force reaches a strength that differs each time, sampled at 2 kHz, with noise of 1 % of a drop.

    .venv/bin/python python/examples/trace.py trace.parquet
"""

import sys

import numpy
import pyarrow
from pyarrow import parquet

#: Stiffness in N/m, velocity in m/s, amplitude in m, step in s, time of a slip in s, noise in N.
STIFFNESS, VELOCITY, AMPLITUDE, STEP, SLIP, NOISE = 2e6, 1e-4, 6e-7, 5e-4, 1e-3, 0.3
#: Mean strength and drop, in N, and the standard deviation of either.
STRENGTH, DROP, SCATTER = 80.0, 30.0, 3.0
FREQUENCIES = (0, 0, 10, 20, 29, 41, 58, 82)
SECONDS = 20


def run(number, frequency, random):
    """Time, force and drive of a run."""
    time = STEP * numpy.arange(round(SECONDS / STEP))
    amplitude = AMPLITUDE if frequency else 0.0
    driven = VELOCITY * time + amplitude * (numpy.cos(2 * numpy.pi * frequency * time) - 1)
    slid = numpy.zeros_like(time)
    end = 0
    while (over := STIFFNESS * driven[end:] - slid[end:] >= random.normal(STRENGTH, SCATTER)).any():
        begin = end + int(numpy.argmax(over))
        slid[begin:] += random.normal(DROP, SCATTER) * numpy.clip((time[begin:] - time[begin]) / SLIP, 0, 1)
        end = begin + round(SLIP / STEP)
    force = STIFFNESS * driven - slid + random.normal(0, NOISE, len(time))
    return {
        "run": numpy.full(len(time), number),
        "t": time,
        "F": numpy.round(1e3 * force).astype("int32"),
        "amplitude": numpy.full(len(time), 1e6 * amplitude),
        "frequency": numpy.full(len(time), float(frequency)),
    }


if __name__ == "__main__":
    random = numpy.random.default_rng(1)
    runs = [pyarrow.table(run(number, frequency, random)) for number, frequency in enumerate(FREQUENCIES)]
    parquet.write_table(pyarrow.concat_tables(runs), sys.argv[1])
