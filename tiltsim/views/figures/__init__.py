"""Figures in print quality, one module per subject, in one style.

Every function returns an independent matplotlib `Figure`, without global state or windows.
matplotlib is imported when a figure is drawn.
"""
