"""Flights in JAX: the programs of closed loops on arrays."""
