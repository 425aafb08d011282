"""Scalar code on arrays and symbols: lifted functions, and flights in JAX."""
