"""``tiltsim check``: every scenario under some paths, for continuous integration."""
