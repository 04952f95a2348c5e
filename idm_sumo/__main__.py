"""``python -m idm_sumo``."""

from idm_sumo.cli import main

main()
