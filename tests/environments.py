"""Separate Python environments, made without network."""

from __future__ import annotations

import sys
import sysconfig
import venv
from pathlib import Path


def new_environment(folder: Path) -> Path:
    """The interpreter of a new environment that sees the packages of this one, tiltsim excepted."""
    venv.create(folder, symlinks=True)
    paths = {"base": str(folder), "platbase": str(folder)}
    site = Path(sysconfig.get_path("purelib", "venv", vars=paths))
    # Path lines only: .pth files in these folders, as of an editable install, are not read.
    shared = [path for path in sys.path if Path(path).name in {"site-packages", "dist-packages"}]
    (site / "shared.pth").write_text("\n".join(shared), encoding="utf-8")
    return Path(sysconfig.get_path("scripts", "venv", vars=paths)) / "python"
