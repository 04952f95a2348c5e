"""Malformed inputs of every kind that is read, made from sound ones by a fixed seed."""
