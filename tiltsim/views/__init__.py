"""Views of flights: figures, Rerun recordings, videos."""
