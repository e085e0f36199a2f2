"""Reads, checks and evaluates what the program stickslip writes.

    tables         tables, reduced data and footers as pandas frames
    statistics     circular statistics, and estimates with confidence intervals
    compare_sets   the difference of two parameter sets, seed by seed (a command)
    oracle         replays a contact log with the exact solution of the model (two commands)
    validation     writes docs/validation.md from measured results (a command)

Commands run as ``python -m stickslip_analysis.NAME``. All quantities are in SI units.
"""
