"""Control laws and what they are made of: decouplers, gains, allocation, supervisor."""
