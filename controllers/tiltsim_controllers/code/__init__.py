"""Trace a control function once; write it as Python, machine code or CasADi.

`tracing.trace` runs a function on symbolic numbers and keeps the operations in order, as a
`program.Program`. The function is ordinary NumPy (`arrays.xp`), so it also runs on real arrays, in
a debugger.
"""
