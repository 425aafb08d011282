"""Vehicle models: parameters, forces and torques, actuators, air."""
