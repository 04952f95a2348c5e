"""``python -m tests.simulators.campaign``."""

from tests.simulators.campaign.run import main

main()
