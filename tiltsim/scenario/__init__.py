"""Scenario files: their tables, checks and the library."""
