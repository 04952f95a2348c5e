"""
Replay a driver in SUMO
=======================

Drive five vehicles by their calibrated parameters while SUMO plays the recorded traffic around them.
SUMO and the compiled kernel drive the same path.
"""

import idm_sumo

path = idm_sumo.surrogate(minutes=2)  # or the path of your own file
recording = idm_sumo.smooth(idm_sumo.clean(idm_sumo.read_recording(path)))
one_period = recording.of_period(recording.periods[0])  # SUMO has one clock
scenes = idm_sumo.build_scenes(one_period).subset(range(20, 25))
drivers = idm_sumo.calibrate(scenes)
in_sumo = idm_sumo.replay(scenes, drivers)
apart = abs(in_sumo.x - idm_sumo.drive_idm(scenes, drivers).x).max()
print(f"SUMO and kernel are {1000 * apart:.3f} mm apart at most")
print(in_sumo.to_pandas()[["period", "vehicle", "frame", "x", "speed", "gap"]].head())
idm_sumo.plot_time_space(scenes, in_sumo)
