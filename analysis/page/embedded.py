"""Data within a page, as JSON that no text in it can break out of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup


def embedded(data: Mapping[str, Any]) -> Markup:
    """Return JSON for a ``script`` element of a page.

    Parameters
    ----------
    data : mapping
        Finite numbers, texts, lists and mappings of them.

    Returns
    -------
    Markup
        JSON in which ``<``, ``>`` and ``&`` are escaped, so that a vehicle's name cannot end the element.
    """
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))
