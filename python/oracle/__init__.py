"""Replays a contact log with the exact solution of the model and reports how far off the solver that wrote it was.

    stickslip simulate --set Delta=1e-6 --set frequency=58 --time 0.2 --set tolerance=1e-10 --contacts log.parquet
    .venv/bin/python -m oracle log.parquet --breaks 1200
    .venv/bin/python -m oracle log.parquet --follow

Between two contact events the model is linear, with damping proportional to mass, so it decouples into modes. With
displacements u counted from the state at the last event, mode z with angular frequency σ obeys

    z'' + γ z' + σ² z = g + e (V0 τ + Δ [cos(ωτ + φ) - cos φ]),

where g is the unbalanced force and e the share of the driving spring, both over the block mass. The solution is a
linear drift, a cosine and a free motion, under-, over- or critically damped: closed forms, evaluated without a time
step. σ and the modes come from the singular values of B with S = m BᵀB (a row sqrt(stiffness/m) for every spring),
which keeps the digits of slow modes beside fast ones.

The log gives thresholds, stiffnesses and the times of reattachment. It does *not* give the times of breaks: these are
solved for (safeguarded Newton on the exact motion, in a bracket that holds the first crossing) and compared with the
log, and the state continues from the oracle's own time. Anchors of reattached contacts are the oracle's own
displacements. Between events every contact is watched: one that is past its threshold by more than the limit on the
residual and does not break counts as missed. The search for crossings halves intervals until bounds decide: over an
interval of length h that starts at a,

    |z''| <= sqrt(z''(a)² + σ² z'(a)²) for each free mode (its energy only falls), so that
    x stays within h²/8 max|x''| of its chord, and x' within h/2 max|x''| of its nearer end.

Nothing relies on sampling, so nothing is missed in long intervals either.

Reported as JSON, over all breaks:
    time error      |predicted - logged| in s, worst and median;
    residual        ||k_i (x - a_i)| - f_i| / f_s, with x the oracle's displacement at the *logged* time;
    displacement    |oracle's - logged| displacement at breaks and reattachments, over f_s/k;
    unreached       breaks in the log where the exact motion turns back or is still short of the threshold much later:
                    they have a residual but no time error;
    missed          contacts past their threshold that the log does not break.

Trajectories of the model are chaotic, the more so the slower the drive: a break that comes a little late meets another
phase of the fast motion. Errors then grow with the number of breaks without any mistake, by a factor of ten every few
breaks for a single block at 1e-6 m/s. With --follow the state continues from the *logged* time of each break instead
of the predicted one. Given the times of all events the motion is linear and damped, so errors do not grow, and the
residuals certify each break of a log of any length and tolerance. The solver's displacements are used in neither mode.

A solver that leaps leaves out motions of tolerance · f_s/k, which show as residuals of that order: for tolerances
above 1e-8 give --residual, and with it --worst and --median, accordingly.

Parameters come from the footer of the log; options (--N, --V0, ...) override it. A replay takes about 3 ms an event at
N = 70.

Exit code: 0 within the limits and nothing missed, 1 beyond one of them, 2 for a log that cannot be replayed.
"""
