"""What a closed loop is: the contract between control laws, vehicles, engines and plants."""
