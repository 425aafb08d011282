"""What people look at: figures, Rerun recordings, videos."""
