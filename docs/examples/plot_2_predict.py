"""
Predict drivers from one second
===============================

Learn from windows all along the drivers' way how one observed second tells of the parameters.
Each driver is predicted by weights that have not seen it, and driven for ten seconds: by predicted IDM
parameters, and by the pooled IDM with a predicted residual, which no vehicle type can hold.
"""

import idm_sumo

path = idm_sumo.surrogate(minutes=2)  # or the path of your own file
recording = idm_sumo.smooth(idm_sumo.clean(idm_sumo.read_recording(path)))
training = idm_sumo.build_scenes(recording, idm_sumo.Window(every=100))  # a window every 10 s
predictor = idm_sumo.RolloutPredictor().fit(training)
scenes = idm_sumo.build_scenes(recording)
predicted = predictor.predict_left_out(scenes).to_pandas()
print(predicted[["period", "vehicle", "a", "b", "T", "d0", "d1", "status", "T_low", "T_high"]].head())
driven = {"predicted": idm_sumo.drive_idm(scenes, predicted), "pooled": idm_sumo.drive_idm(scenes, predictor.pooled_)}
residual = idm_sumo.ResidualPredictor(one_for_all=predictor.pooled_).fit(training).predict_left_out(scenes)
driven["residual"] = idm_sumo.drive_residual(scenes, residual)
print({name: f"{idm_sumo.score(scenes, one)['ade_m'].mean():.2f} m" for name, one in driven.items()})
idm_sumo.plot_time_space(scenes, driven, which=10)
