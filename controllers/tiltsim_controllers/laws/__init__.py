"""Control laws and their parts: decouplers, gains, allocation, supervisor."""
