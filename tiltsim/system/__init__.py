"""The operating system: signals, locks, processes, atomic files."""
