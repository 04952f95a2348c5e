"""
Export drivers to SUMO
======================

Write one vehicle type a driver, its vehicle and the configuration that runs them. SUMO's IDM has no
``d1``, so the drivers are refitted without it to the scenes that they come from.
"""

from pathlib import Path
from tempfile import mkdtemp

import idm_sumo

path = idm_sumo.surrogate(minutes=2)  # or the path of your own file
recording = idm_sumo.smooth(idm_sumo.clean(idm_sumo.read_recording(path)))
scenes = idm_sumo.build_scenes(recording.of_period(recording.periods[0]))
drivers = idm_sumo.calibrate(scenes)
exported = idm_sumo.export_routes(drivers, Path(mkdtemp()) / "drivers.rou.xml", departures=scenes)
print(f"{len(exported.vehicles)} vehicles; run them with: sumo -c {exported.config_file}")
for note in exported.notes:
    print("note:", note)
