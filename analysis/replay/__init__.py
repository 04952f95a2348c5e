"""One replay to look at."""
