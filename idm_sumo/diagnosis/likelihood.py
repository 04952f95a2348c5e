r"""How likely each driver's windows are by a fit, whatever the driver's parameters.

Unlike what a fitted driver leaves, this does not favour laws whose parameters take up more of the noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis.fit import FREEDOM, Fit, linearise
from idm_sumo.diagnosis.windows import Windows


def log_likelihood(windows: Windows, fit: Fit) -> npt.NDArray[np.float64]:
    r"""Return the logarithm of each driver's marginal likelihood, shape ``(drivers,)``; no window counts less than another.

    Around the fitted drivers, what a driver leaves in all windows has the covariance
    :math:`C = V + J\Lambda J^\top` (Laird and Ware 1982), once the own parameters are integrated out. Few drivers err by many times as
    much as others; so it is taken for a multivariate t with :data:`FREEDOM` degrees of freedom (Lange, Little and Taylor 1989).
    """
    line = linearise(windows, replace(fit, weight=np.ones(len(windows.seen))))
    error, jacobian = line.whitener @ line.error[:, :, None], line.whitener @ line.jacobian
    turned = jacobian.transpose(0, 2, 1)
    driver, drivers = windows.driver, windows.drivers
    inner = gls.by_driver(turned @ jacobian, driver, drivers) + np.linalg.inv(fit.spread)
    pull = gls.by_driver(turned @ error, driver, drivers)[:, :, 0]
    distance = gls.by_driver((error[:, :, 0] ** 2).sum(axis=1), driver, drivers)
    distance -= np.einsum("ip,ip->i", pull, np.linalg.solve(inner, pull[:, :, None])[:, :, 0])
    volume = -2.0 * gls.by_driver(np.log(np.diagonal(line.whitener, axis1=1, axis2=2)).sum(axis=1), driver, drivers)
    volume += np.linalg.slogdet(inner)[1] + np.linalg.slogdet(fit.spread)[1]
    count = np.bincount(driver, minlength=drivers) * error.shape[1]
    both = FREEDOM + count
    scale = gammaln(both / 2) - gammaln(FREEDOM / 2) - 0.5 * count * np.log(FREEDOM * np.pi)
    return np.asarray(scale - 0.5 * volume - 0.5 * both * np.log1p(distance / FREEDOM))
