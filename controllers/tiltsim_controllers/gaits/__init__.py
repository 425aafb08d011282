"""Gaits: the tilt angles as functions of time alone, planned before the flight (ch. 3 to 9).

A flight evaluates `tiltsim_controllers.gaits.motion`; `tiltsim_controllers.gaits.plans` builds its
parameters and knows period, amplitude, rate and continuity.
"""
