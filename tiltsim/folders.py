"""The order of the folders: each imports from itself and from those before it, never later ones."""

from typing import Final

CONTROLLERS: Final = (
    "code",
    "mathematics",
    "vehicle",
    "gaits",
    "references",
    "laws",
    "analysis",
    "tilt_car",
)
"""Folders of `tiltsim_controllers`, which knows neither tiltsim nor MuJoCo."""

FLYING: Final = (
    "system",
    "models",
    "scenario",
    "closed_loop",
    "vehicles",
    "equations",
    "arrays",
    "engines",
    "laws",
    "plants",
    "flight",
    "simulation",
)
"""Folders of `tiltsim` that a flight and its metrics depend on."""

SHOWING: Final = ("logs", "linear", "sweeps", "studies", "views", "env", "report", "commands")
"""Folders of `tiltsim` that use flights; none of them changes one."""

FOUNDATION: Final = ("errors", "resources", "folders")
"""Modules directly in `tiltsim` that every folder may import."""

ENTRANCE: Final = ("cli", "__main__", "__init__")
"""Modules directly in `tiltsim` that may import every folder."""
