"""The reproduction report: the claims of the thesis compared with measured values.

A claim comes from one of two places.

**One flight is enough.** The claim is in the scenario file::

    [[variant.expect]]
    metric = "final_position_error_x"
    min = -0.37948                # bounds are for `tiltsim check`: our values
    max = -0.37928
    claim = "Steady error along x at rho = 0.65, modified decoupler"
    published = -0.38             # the printed value

`tiltsim.scenario.expectation.Expectation` describes the keys. Variants with the same ``claim`` are
shown as cases of one claim, labelled with their titles. With a boolean metric, ``published`` is
compared with the metric; with any other, true or false states whether the value is within ``min``
and ``max`` according to the thesis. A number is reproduced to half a unit of its last digit (3.35
means 3.345 to 3.355), or to 0.05 for an integer. ``wrong = true`` is for a statement refuted by
proof or by the thesis's own equations, not merely not observed; if the measured value agrees
nevertheless, the claim counts as reproduced.

The chapter comes from the scenario's ``source`` ("ch. 4, Sec. 6.1, Fig. 4 (A1)"). Each plant gets
its own verdict. Expectations with the same claim and metric but different ``plant`` are one row.

**Analysis or several flights are needed.** The claim is in a module of `tiltsim.report.claims`, one
per chapter, in a tuple ``CLAIMS`` of `AnalysisClaim` and `FlightClaim`; see there for examples. No
measured value is written down: verdicts are computed when the report is made.
"""
