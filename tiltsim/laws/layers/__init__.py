"""Layers around a closed loop: actuators, air, supervisor, actuator-level equations."""
