"""Controllers in closed loops with their vehicles, one module per controller."""
