"""Studies that fly or analyse many cases: checks of the library, benchmark, gait analysis."""
