"""Many recordings: calibrated, predicted or diagnosed, here or on a cluster, into one data set."""
