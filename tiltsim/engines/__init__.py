"""Engines that evaluate a control step: Python and compiled code."""
