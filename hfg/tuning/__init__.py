"""Searches over many runs of a graph in virtual time: the parameters that make a score best, and tables of what if.

tuning      `tune`: candidates by a method, a generation at a time
sweeping    `sweep`: every combination of listed values and happenings, with confidence intervals
space       parameters as numbers from 0 to 1
methods     random, grid, differential evolution        packages    CMA-ES, Parzen estimators
losses      which candidate is better                   figures     means and their intervals
scores      what a run is judged by                     happenings  what happens in a run
evaluating  one run of one candidate                    searching   many, with what they cost
workers     the processes                               journal     a line for each run
judging     one candidate after the other, for nodes     plotting    drawings
"""

from hfg.tuning.evaluating import Told
from hfg.tuning.figures import Mean, mean_of, paired
from hfg.tuning.judging import Judge
from hfg.tuning.scores import Finished
from hfg.tuning.searching import Evaluation
from hfg.tuning.space import read_parameter
from hfg.tuning.sweeping import Sweep, sweep
from hfg.tuning.tuning import Confirmation, Tuning, tune

__all__ = [
    "Confirmation",
    "Evaluation",
    "Finished",
    "Judge",
    "Mean",
    "Sweep",
    "Told",
    "Tuning",
    "mean_of",
    "paired",
    "read_parameter",
    "sweep",
    "tune",
]
