"""Figures in print quality, one module per subject, in one style.

Every function returns an independent matplotlib `Figure` and imports matplotlib when it is called.
"""
