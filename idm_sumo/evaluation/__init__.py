"""How far a simulation is from a recording."""
