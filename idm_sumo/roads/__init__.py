"""The road that traffic was recorded on."""
