"""The reproduction report: the claims of the thesis compared with measured values.

A claim comes from one of two places.

**One flight is enough.** The claim is in the scenario file::

    [[variant.expect]]
    metric = "final_position_error_x"
    min = -0.37948                # bounds are for `tiltsim check`: our values
    max = -0.37928
    claim = "Steady error along x at rho = 0.65, modified decoupler"
    published = -0.38             # the printed value

* ``claim``: the statement of the thesis, in our words; variants with the same sentence are shown as
  cases of one claim, labelled with their titles. The default is the name of the metric.
* ``published``: a number, or true/false. With a boolean metric it is compared with the metric; with
  any other it states whether the value is within ``min`` and ``max`` according to the thesis. So
  ``metric = "diverged"``, ``equals = true``, ``published = false`` is a flight that completes in
  the thesis and diverges here; ``metric = "max_tilt_rate"``, ``min = 20.0``, ``published = true``
  means that tilting is fast in the thesis, too.
* ``published_tolerance``: difference up to which numbers count as equal; by default half a unit of
  the last digit (3.35 means 3.345 to 3.355; the tolerance of an integer is 0.05).
* ``in_kind = [low, high]``: the range in which the statement still holds although the number
  differs; ``inf`` is allowed.
* ``why``: the reason if it is not reproduced (required then).
* ``wrong = true``: the statement is refuted, by proof or by the thesis's own equations, not merely
  not observed. If the measured value agrees nevertheless, the claim counts as reproduced.

The chapter comes from the scenario's ``source`` ("ch. 4, Sec. 6.1, Fig. 4 (A1)"). Each plant gets
its own verdict. Expectations with the same claim and metric but different ``plant`` are one row.

**Analysis or several flights are needed.** The claim is in a module of `tiltsim.report.claims`, one
per chapter, in a tuple ``CLAIMS`` of `AnalysisClaim` and `FlightClaim`; see there for examples. No
measured value is written down: verdicts are computed when the report is made.
"""
