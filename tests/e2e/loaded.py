"""Loads what sweeps load, for processes forked from the one that has imported this."""

import tiltsim.cli
import tiltsim.commands.many
import tiltsim.plants.plant
import tiltsim.simulation.native_batch
import tiltsim.sweeps.running  # noqa: F401
