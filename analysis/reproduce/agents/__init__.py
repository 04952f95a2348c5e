"""The learned agent in the study."""
