"""Units that sources use in place of SI."""

FOOT = 0.3048  # m, exactly
MILE_PER_HOUR = 0.44704  # m/s, exactly
