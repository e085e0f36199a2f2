"""Parameter sweeps of stick-slip friction: a slider held by breakable contacts (Capozza et al., PRL 107, 024301, 2011).

    import stickslip

    one = stickslip.simulate(Delta=1e-6, frequency=29, slips=20)     one realisation
    results = stickslip.run("sweeps/fig3.toml")                      a sweep, or what is missing of it
    results = stickslip.open("results/fig3")                         what is there
    results = stickslip.measured(table, "results/mine", ...)         measured slips

    results.slips().to_pandas()          or to_polars(), to_pyarrow(); DuckDB takes the table directly
    results.plot.phase_eta()             a figure to build on

All quantities are in SI units, which tables name (`results.slips().units`). Keys are those of a sweep file:
`help(stickslip.simulate)` lists them with units and defaults.

Further modules: `statistics` (circular statistics, estimates with confidence intervals) and `tables` (pandas frames). They
need numpy, pandas, pyarrow and scipy.
"""

from ._stickslip import VERSION as __version__
from ._stickslip import ResultsError, SimulationError, SweepError, Table
from .measured import measured
from .progress import Progress
from .results import Results, open
from .simulation import Simulation, simulate
from .sweep import run

# Without `open`, which would hide Python's own.
__all__ = [
    "Progress",
    "Results",
    "ResultsError",
    "Simulation",
    "SimulationError",
    "SweepError",
    "Table",
    "__version__",
    "measured",
    "run",
    "simulate",
]
