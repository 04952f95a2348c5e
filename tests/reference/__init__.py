"""Values from outside or from an earlier version, kept to be compared with."""
