"""The example package, installed from its wheel: flown, checked, described, and in the arena."""

import json
import subprocess
import sys
from pathlib import Path

SCENARIO = """
[controller]
law = "steady"

[simulation]
duration = 6.0
timestep = 0.004

[reference]
type = "setpoint"
position = [0.2, 0.1, 0.3]

[[expect]]
metric = "final_position_error_x"
min = -0.01
max = 0.01
"""


def tiltsim(*arguments: str) -> str:
    """What a command of tiltsim prints; it must succeed."""
    command = (sys.argv[1], *arguments)
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


Path("steady.toml").write_text(SCENARIO, encoding="utf-8")
tiltsim("run", "steady.toml", "--quiet", "--out", "steady")
assert json.loads(Path("steady/metrics.json").read_text())["diverged"] is False
assert "1 passed" in tiltsim("check", "steady.toml")
assert "removes steady errors" in tiltsim("schema", "controller.steady")
arena = (
    "--league",
    "unlimited",
    "--vehicles",
    "quadrotor",
    "--controllers",
    "steady",
    "--jobs",
    "1",
)
rows = json.loads(tiltsim("arena", *arena, "--out", "arena", "--json"))["vehicles"]["quadrotor"]
assert len(rows) == 9
assert all(row["controller"] == "steady" and row["score"] > 0.0 for row in rows)
