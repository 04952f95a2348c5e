"""A replay is drawn where the caller says, with everybody who was there."""

import numpy as np
from matplotlib.figure import Figure

from idm_sumo.evaluation.figures import plot_time_space
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.simulation.rollout import drive_constant_velocity, drive_idm
from tests.helpers.builders import Car, scenes


def test_the_recorded_vehicle_the_modelled_ones_and_the_others_are_drawn_in_the_given_axes():
    some = scenes(Car(1), Car(2, x=30.0), Car(3, x=30.0, lane=4))
    driven = {"IDM": drive_idm(some, TEXTBOOK), "still": drive_constant_velocity(some)}
    ax = Figure().subplots()
    assert plot_time_space(some, driven, ax=ax, colours={"IDM": "#009E73"}) is ax
    recorded, idm, still = ax.lines
    np.testing.assert_array_equal(recorded.get_ydata(), some.x[0, some.start :])
    np.testing.assert_array_equal(idm.get_ydata(), driven["IDM"].x[0])
    assert (idm.get_color(), still.get_label()) == ("#009E73", "still")
    (others,) = ax.collections
    assert len(others.get_offsets()) == some.window.horizon + 1  # of the lane's own other vehicle, every frame
    assert "p1" in ax.get_title()


def test_trajectories_alone_are_called_modelled():
    some = scenes(Car(1), Car(2, x=30.0))
    ax = plot_time_space(some, drive_idm(some, TEXTBOOK), ax=Figure().subplots())
    assert [line.get_label() for line in ax.lines] == ["recorded", "modelled"]
