"""
Diagnose what the model gets wrong
==================================

Ask what is in the recorded vehicles that the simulation lacks. The answer is a verdict, the causes
with their sizes, and what was looked for and is not there.
"""

import idm_sumo

path = idm_sumo.surrogate(minutes=1)  # or the path of your own file
recording = idm_sumo.clean(idm_sumo.read_recording(path))  # not smoothed: the noise is part of the question
some = recording.of_period(recording.periods[0])  # some forty drivers; leave this out and hundreds tell more
found = idm_sumo.diagnose(some, seed=1)
print(f"verdict: {found.verdict}")
for cause in found.causes:
    print(cause.name, {name: estimate.value for name, estimate in cause.parameters.items()})
for one in found.ruled_out[:5]:
    print(f"not there: {one.name}")
