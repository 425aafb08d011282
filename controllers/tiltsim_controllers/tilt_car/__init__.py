"""The tilt-car of ch. 10 and 11: two thrusts on a disc that turns on a disc that slides."""
