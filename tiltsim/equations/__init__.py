"""The thesis' own equations of motion, one module a vehicle, for `tiltsim.plants.ThesisPlant`."""
