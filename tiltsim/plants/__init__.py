"""Plants: vehicles under control that can be advanced, observed and restarted."""
