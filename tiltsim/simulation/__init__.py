"""Fly scenarios: one at a time and in batches."""
