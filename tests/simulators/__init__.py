"""Simulators that hide an effect in a recording, and the campaign that counts what is found."""
