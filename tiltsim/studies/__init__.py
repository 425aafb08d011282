"""Studies that fly or analyze many cases: checks of the library, benchmark, gait analysis."""
