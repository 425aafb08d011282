"""The contract between control laws, vehicles, engines and plants."""
