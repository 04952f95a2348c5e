"""Driver tables: a recording's drivers calibrated or predicted."""
