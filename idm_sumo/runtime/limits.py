"""Within which numbers of the command line, of run files and of tables lie, bounds included."""

FRAMES = (1, 36_000)  # of a window: an hour
OBSERVED = (2, 36_000)  # frames of a driving code: a speed needs two
NEIGHBOURS = (1, 100_000)
SEED = (0, 2**32 - 1)  # what every generator of random numbers takes
VEHICLE = (0, 2**53 - 1)  # numbers of vehicles, exact in every layout
JOBS = (1, 1024)
COUNT = (1, 10**9)  # of drivers, agents, steps
INJECTIONS = (0, 1000)  # of each effect and size
MINUTES = (0.1, 24 * 60.0)  # of the built-in recording
DESIRED_SPEED = (1.0, 100.0)  # m/s
