"""The reproduction report: the claims of the thesis compared with measured values.

A **statement** (`tiltsim.report.claim.Statement`, whose fields are the keys of its table) is
one thing that the thesis says. Its ``id`` is the anchor on the page, never changed once published.

A **row** (`tiltsim.report.claim.Claim`) is one case of a statement. Its id is the statement's id
and its label; ids that are gone are in ``withdrawn.toml``. `Origin` names the parts that do not
come from the thesis: in scenario files for their flights (``ours = ["path", "gains", "start"]``),
in statements and rows for their computations. Where the flight is ours the published value is shown
as implied. A row that holds because parameters were chosen so (``fitted``) is no evidence, and none
against the thesis if it fails.

A row that does not hold names its ``fault`` if a proof says why, see
`tiltsim.report.claim.ClaimVerdict`; one that is refuted or misprinted also the ``error`` that it
belongs to in the list of errors. A value that the thesis does not claim is no row.

**One flight is enough.** The row is in the scenario file::

    [claim.ch4-rest]
    statement = "The vehicle comes to rest beside the reference"
    thesis = "Fig. 4 prints both components for every rho."
    criterion = "Each component rounds to the printed digits"

    [[variant.expect]]
    metric = "final_position_error_x"
    min = -0.37948                # bounds are for `tiltsim check`: our values
    max = -0.37928
    claim = "ch4-rest"
    case = "x"                    # if a flight has several rows of the claim
    published = -0.38             # the printed value

`tiltsim.scenario.expectation`, with `Expectation` and `ClaimTable`, describes the
keys. Rows are labeled with the titles of their variants. With a boolean metric, ``published`` is
compared with the metric; with any other, true or false states whether the value is within
``holds``, where the sentence is true, which is not the narrow range around our own value. A number
is reproduced to half a unit of its last digit (3.35 means 3.345 to 3.355), or to 0.05 for an
integer. ``source`` of the row is the scenario's. Each plant gets its own verdict. Expectations with
the same claim and case but different ``plant`` are one row. ``claim`` may also be a sentence, which
then is the whole statement; files of the library use tables.

**Analysis or several flights are needed.** The row is in a file of `tiltsim.report.claims`, one
per chapter, with an expression of metrics and of functions of `tiltsim.report.measures`. Its value
is yes or no, a number, or several numbers.

No measured value is written down: verdicts are computed when the report is made. Texts may have
`code` between backticks. ``tests/report/test_statements.py`` checks every row.
"""
