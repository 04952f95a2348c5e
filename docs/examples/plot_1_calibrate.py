"""
Calibrate drivers
=================

Fit five IDM parameters to every driver of the built-in recording. The table says how far each one
stays from its recorded vehicle, and which parameters its window did not determine.
"""

import idm_sumo

path = idm_sumo.surrogate(minutes=2)  # or the path of your own file
recording = idm_sumo.smooth(idm_sumo.clean(idm_sumo.read_recording(path)))
print(recording)
scenes = idm_sumo.build_scenes(recording)  # one second observed, ten simulated
print(scenes)
drivers = idm_sumo.calibrate(scenes)
print(drivers[["period", "vehicle", "a", "b", "T", "d0", "d1", "desired_speed_m_s", "ade_m", "status"]].head())
driven = idm_sumo.drive_idm(scenes, drivers)
print(f"mean ADE {idm_sumo.score(scenes, driven)['ade_m'].mean():.2f} m")
idm_sumo.plot_time_space(scenes, driven, which=10)
