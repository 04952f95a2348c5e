"""The paper's printed results: value and standard error in metres."""

from __future__ import annotations

from typing import NamedTuple


class Printed(NamedTuple):
    """One row of a table of the paper."""

    ade_m: float
    ade_se_m: float
    fde_m: float
    fde_se_m: float
    collisions: int


# Table "Test Results over 1484 cars".
METHODS = {
    "constant_velocity": Printed(7.94, 0.19, 14.36, 0.45, 1467),
    "irl_rl": Printed(6.41, 0.32, 17.50, 0.74, 766),
    "idm_average": Printed(5.87, 0.17, 8.94, 0.40, 0),
    "idm_prediction": Printed(4.80, 0.15, 7.40, 0.37, 0),
    "idm_oracle": Printed(4.38, 0.15, 7.39, 0.36, 0),
}

# Table "Effect of Driving Code on IDM Pred.": nu velocity, omega time headway, tau lateral offset.
FEATURES = {
    "nu": Printed(5.57, 0.17, 8.50, 0.39, 0),
    "omega": Printed(4.90, 0.15, 7.60, 0.37, 0),
    "tau": Printed(5.35, 0.17, 8.11, 0.38, 0),
    "nu+omega": Printed(4.95, 0.15, 7.60, 0.37, 0),
    "nu+tau": Printed(5.53, 0.16, 8.34, 0.39, 0),
    "omega+tau": Printed(4.76, 0.15, 7.35, 0.37, 0),
    "nu+omega+tau": Printed(4.80, 0.15, 7.40, 0.37, 0),
}

# Table "Effect of Frame Number".
FRAMES = {
    2: Printed(5.32, 0.15, 8.31, 0.37, 0),
    4: Printed(5.22, 0.15, 8.23, 0.37, 0),
    6: Printed(5.01, 0.15, 8.05, 0.37, 0),
    10: Printed(4.80, 0.15, 7.40, 0.37, 0),
    20: Printed(4.80, 0.15, 7.40, 0.37, 0),
}

NEIGHBOURS = 8
TEST_VEHICLES = 1484  # of 1,521 modelled ones
TRAINING_VEHICLES = 1992
COUNTED_TRAINING, COUNTED_TEST, MODELLED_TEST = 2169, 2017, 1521  # the official counts, and what the paper models
MISSING = 1.0 - MODELLED_TEST / COUNTED_TEST  # of the test period's vehicles
