"""Names shared by recordings, live streams and the viewer."""

from __future__ import annotations

from typing import Final

APPLICATION: Final = "tiltsim"


TIMELINE: Final = "sim_time"
