"""Kinds of vehicles: the parts that all closed loops around one kind share."""
