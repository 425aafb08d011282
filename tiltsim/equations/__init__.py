"""The thesis's own equations of motion, one module per vehicle."""
