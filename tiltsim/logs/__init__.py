"""Logs: flights in the formats of other tools, and flights of real vehicles."""
