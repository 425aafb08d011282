"""The reproduction report: what the thesis states beside what is measured, claim by claim.

A claim comes from one of two places.

**A flight shows it.** It is written where the flight is, in the scenario file::

    [[variant.expect]]
    metric = "final_position_error_x"
    min = -0.37948                # bounds are for `tiltsim check`: what we measure
    max = -0.37928
    claim = "Steady error along x at rho = 0.65, modified decoupler"
    published = -0.38             # what the thesis prints

* ``claim``: what the thesis states, in our words; variants that share one sentence are shown as
  cases of one claim, told apart by their titles. Without it the metric's meaning stands there.
* ``published``: a number, or true/false. On a metric that is true or false it is compared with the
  metric; on any other it answers whether, says the thesis, the value lies within ``min`` and
  ``max``. So ``metric = "diverged"``, ``equals = true``, ``published = false`` is a flight that the
  thesis completes and that is lost here, and ``metric = "max_tilt_rate"``, ``min = 20.0``,
  ``published = true`` says that the thesis, too, finds tilting fast.
* ``published_tolerance``: what still counts as the same number; by default half a unit of the last
  digit (3.35 means 3.345 to 3.355; a whole number is good to 0.05).
* ``in_kind = [low, high]``: where the statement still holds though the number differs; ``inf`` is
  allowed.
* ``why``: the reason where it does not come out (then it must be there).
* ``wrong = true``: what the thesis states is refuted, by proof or by its own equations, not merely
  not seen. Where the measured value agrees after all, the claim counts as reproduced.

The chapter comes from the scenario's ``source`` ("ch. 4, Sec. 6.1, Fig. 4 (A1)"). Each plant is
judged by itself. Two expectations with the same claim and metric, one a ``plant``, are one row.

**Analysis or several flights show it.** It is entered in a module of `tiltsim.report.claims`, one a
chapter, in a tuple ``CLAIMS`` of `AnalysisClaim` and `FlightClaim`; see there for examples. Nothing
measured is ever written down: verdicts are computed when the report is made.
"""
