"""Kinds of vehicles: what all closed loops around one kind share."""
