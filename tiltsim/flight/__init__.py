"""Recorded flights: columns, metrics, files and verdicts."""
