"""A stand-in recording, made with SUMO."""
