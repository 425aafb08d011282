"""The control stack of tiltsim and its mathematics.

Every control law, gait and reference is a pure function on floats, so that one source serves the
Python engine, MuJoCo's native control callback, batches and the analysis. The package depends
neither on MuJoCo nor on the testbed.

Conventions: world z up; body axes x forward, y left, z up; rotor 1 on +x, 2 on +y, 3 on -x, 4 on
-y; each pod tilts about its arm's outward axis. SI units and radians throughout.
"""
