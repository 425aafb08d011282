"""Mathematics in scalar form: rotations, jets, records, noise."""
