"""Files that ship with the package: vehicle models and the scenario library."""

from pathlib import Path


def shipped_folder(name: str) -> Path:
    """The folder ``mjcf`` or ``scenarios``: inside an installed package, else in the checkout."""
    package = Path(__file__).resolve().parent
    installed = package / name
    return installed if installed.is_dir() else package.parent / name
