"""Reference trajectories: where the vehicle should be over time."""
