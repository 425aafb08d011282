"""A tiny library: a family that hovers, one that diverges, one that only MuJoCo supports."""

from __future__ import annotations

import pytest

HOVER = """
title = "Hover"
source = "ch. 4, Sec. 6.1, Fig. 4"

[simulation]
duration = 0.4
timestep = 0.002

[controller]
law = "attitude_altitude"
decoupler = "conventional"

[[variant]]
name = "level"
title = "no tilt"
gait = { type = "fixed", angles = [0.0, 0.0, 0.0, 0.0] }

[[variant.expect]]
metric = "final_position_error_x"
min = -1e-6
max = 1e-6
claim = "It stays where it is"
published = 0.0
published_tolerance = 0.001

[[variant]]
name = "tilted"
title = "tilted"
gait = { type = "fixed", angles = [-0.3, -0.3, 0.3, 0.3] }

[[variant.expect]]
metric = "final_position_error_x"
max = 10.0
claim = "It stays where it is"
published = 5.0
in_kind = [-1.0, 1.0]
why = "The flight is short."

[[variant.expect]]
metric = "diverged"
equals = false
claim = "It flies | to the end"
published = true
why = "It does `not` end <early>."
"""

LOST = """
title = "Blue"
source = "ch. 6, Sec. 5.1"

[simulation]
duration = 0.4
timestep = 0.002

[controller]
law = "attitude_altitude"
decoupler = "conventional"

[initial]
attitude = [3.0, 0.0, 0.0]

[[expect]]
metric = "diverged"
equals = true
claim = "The flight terminates early"
published = true

[[expect]]
metric = "final_roll"
max = 10.0
claim = "It ends level"
published = 0.0
"""

BOUNDED = """
title = "Ground, which the thesis plant does not know"
source = "ch. 9, Sec. 3"

[simulation]
duration = 0.2
timestep = 0.002

[ground]
height = -1.0

[controller]
law = "attitude_altitude"
decoupler = "conventional"

[[expect]]
metric = "max_rotor_speed"
max = 1.0
claim = "Rotors are slow"
published = false
"""


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    """The folder of the tiny library."""
    folder = tmp_path_factory.mktemp("library")
    for name, text in {"hover": HOVER, "lost": LOST, "bounded": BOUNDED}.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def kept(tmp_path_factory):
    """The folder where the reports of a session store their flights."""
    return tmp_path_factory.mktemp("report") / "kept"


@pytest.fixture(scope="session")
def report(library, kept):
    """The report on the tiny library."""
    from tiltsim.report.making import make_report

    return make_report([str(library)], kept, 1)
