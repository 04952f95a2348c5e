"""A second simulator for blind trials, and what is hidden in its traffic.

Whoever wrote it knew the catalogue of effects and the layout of the files, and neither the finder nor the simulator in
``tests/simulators/first``: other car-following laws, lane changes, noise, forms of each effect, and other effects
outside the catalogue.

    python -m tests.simulators.second -o DIR --seed S     # recordings and what is hidden in them
    python -m tests.simulators.campaign --simulator second -o DIR --seed S     # found, and how often rightly
"""

from tests.simulators.second.cases import plan
from tests.simulators.second.gain import worth
from tests.simulators.second.recordings import make, truth

__all__ = ["make", "plan", "truth", "worth"]
