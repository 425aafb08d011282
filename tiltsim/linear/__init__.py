"""Linear analysis of closed loops: rest points, periodic orbits, margins, regions of attraction."""
