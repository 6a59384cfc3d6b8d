"""What fixes a section's frame: its heading, which is nobody's business, and the Earth's rotation at the site."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.calibration.equations.causes import EARTH_RATE_KNOWN
from tumble.calibration.equations.state import EARTH, NODE, RecordingState, Section
from tumble.earth import EARTH_RATE, Site
from tumble.estimation import Equations, Linear, View

# The heading of a section is nobody's business; this fixes it.
HEADING_SIGMA = 1e-4  # rad
# Of a latitude that is given to a hundredth of a degree; near a pole or the equator one component of the Earth rate
# would be all but exact.
LATITUDE_SIGMA = 1e-4  # rad
LEAST_SHARE = 0.1
# Share of what a latitude says that the gyros check; less is round-off.
CHECKED_EARTH = 1e-7
# What holds the attitudes of a hold whose force is left out, where nothing else does.
LOOSE_SIGMA = 0.1  # rad


class Heading(Equations):
    """The heading of a node is as it is: of a section's first hold, or of one that nobody carries on."""

    kind, cause = "heading", EARTH_RATE_KNOWN

    def __init__(self, node: int = 0, sigma: float = HEADING_SIGMA) -> None:
        self.place, self.node, self.sigma = np.array([-1]), np.array([node]), sigma

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return one residual, rad, that is zero wherever the heading is."""
        by_node = np.zeros((1, 1, NODE))
        by_node[0, 0, 2] = 1.0
        by_border = np.zeros((1, 1, 3 + state.unknowns.free.size))
        return [Linear(np.zeros((1, 1)), np.full((1, 1, 1), self.sigma**2), by_border, self.node, by_node)]


class Loose(Equations):
    """Holds whose force is left out stay about where they are: so steps are finite where nothing else says."""

    kind = "loose"

    def __init__(self, section: Section, gone: np.ndarray) -> None:
        self.place, self.node = section.holds[gone], np.flatnonzero(gone)

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return nine residuals a hold that are zero wherever it is, and no observations."""
        count = self.node.size
        unit = np.broadcast_to(np.eye(NODE), (count, NODE, NODE))
        by_border = np.zeros((count, NODE, 3 + state.unknowns.free.size))
        zero = np.zeros((count, NODE))
        return [Linear(zero, LOOSE_SIGMA**2 * unit, by_border, self.node, unit, counted=0)]

    def causes(self, state: RecordingState, linear: Linear) -> dict[str, AnyArray]:
        """Return none: it is no observation."""
        return {}


class EarthRate(Equations):
    """What the site says of a section's Earth rate: its vertical part, and how large the level one is."""

    kind, cause = "earth", EARTH_RATE_KNOWN

    def __init__(self, section: Section) -> None:
        self.section, self.place = section, np.array([-1])

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return three or four residuals, rad/s, that count as three."""
        site, earth = state.site, self.section.earth_w
        mean, sigma = _earth_prior(site)
        residual, by_earth = earth - mean, np.eye(3)
        if site.latitude is not None and self.section.sees_north:
            # Its direction is the gyros' to tell; its length the latitude does.
            length = float(np.linalg.norm(earth[:2]))
            residual = np.append(residual, length - EARTH_RATE * float(np.cos(site.latitude)))
            by_earth = np.concatenate([by_earth, [[earth[0] / length, earth[1] / length, 0.0]]])
            sigma = np.append(sigma, _known_to(np.sin(site.latitude)))
        by_border = np.zeros((1, residual.size, 3 + state.unknowns.free.size))
        by_border[0, :, EARTH] = by_earth
        return [Linear(residual[None], np.diag(sigma**2)[None], by_border, counted=3)]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return the vertical part where a latitude determines it, however little the gyros check it."""
        if state.site.latitude is None:
            return []
        vertical = np.zeros((1, linear.residual.shape[1]))
        vertical[0, 2] = 1.0
        return [View("earth", vertical, least=CHECKED_EARTH)]


def _earth_prior(site: Site) -> tuple[Series, Series]:
    """Return mean and standard deviation (3,) rad/s of the Earth rate in a level frame of any heading."""
    latitude = site.latitude
    if latitude is None:
        mean, sigma = np.zeros(3), np.full(3, EARTH_RATE / np.sqrt(3.0))
    else:
        across = EARTH_RATE * max(float(np.cos(latitude)), 1e-3) / np.sqrt(2.0)
        mean = np.array([0.0, 0.0, -EARTH_RATE * np.sin(latitude)])
        sigma = np.array([across, across, _known_to(np.cos(latitude))])
    return mean, sigma


def _known_to(share: float) -> float:
    """Return the sigma, rad/s, of a component of the Earth rate that a latitude moves by a share of its error."""
    return LATITUDE_SIGMA * EARTH_RATE * max(abs(float(share)), LEAST_SHARE)
