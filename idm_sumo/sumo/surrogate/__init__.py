"""A stand-in recording, made with SUMO."""

SURROGATE = "surrogate"  # what stands for its path wherever a recording is named
