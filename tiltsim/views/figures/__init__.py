"""Figures that a paper could print; one module a subject, one style for all.

Every function returns a matplotlib `Figure` that belongs to nobody else: no global state, no
window. matplotlib is imported when a figure is drawn, not before.
"""
