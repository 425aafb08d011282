"""Seeded random inputs, generated from the schemas and parsers themselves."""
