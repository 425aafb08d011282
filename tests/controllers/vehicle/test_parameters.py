"""The named vehicles, compared with the print by hand."""

from __future__ import annotations

from tiltsim_controllers.vehicle.parameters import PRESETS


def test_vehicles_are_as_printed():
    """Ch. 3, Sec. 2; ch. 2, Table A1, with ch. 3's rotors; Luukkonen (2011), Table 1."""
    moments = (2.24e-3, 2.99e-3, 4.80e-3)
    assert PRESETS["ar_drone_2"] == (0.429, *moments, 0.1785, 8.048e-6, 2.423e-7, 9.8)
    moments = (2.237568e-3, 2.985236e-3, 4.80374e-3)
    assert PRESETS["ar_drone_2_unrounded"] == (0.429, *moments, *PRESETS["ar_drone_2"][4:])
    moments = (4.856e-3, 4.856e-3, 8.801e-3)
    assert PRESETS["luukkonen"] == (0.468, *moments, 0.225, 2.98e-6, 1.14e-7, 9.81)
