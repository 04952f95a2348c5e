"""A second simulator for blind trials, and what is hidden in its traffic.

Whoever wrote it knew the catalogue of effects and the layout of the files, and neither the finder nor the simulator in
``tests/planting``: other car-following laws, lane changes, noise, forms of each effect, and other effects outside the catalogue.

    python -m tests.elsewhere -o DIR --seed S     # recordings and what is hidden in them
    python -m analysis.campaign --planter elsewhere -o DIR --seed S     # found, and how often rightly
"""

from .cases import plan
from .gain import worth
from .recordings import make, truth

__all__ = ["make", "plan", "truth", "worth"]
