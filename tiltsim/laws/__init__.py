"""Control laws in closed loops with the vehicles, one module per law."""
