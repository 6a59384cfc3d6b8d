"""What several tests of recovery play: one unit on a table, what is found of it, and how far off it is."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tumble.calibration import Estimate, Options, Session, calibrate, find_procedure
from tumble.earth import Site
from tumble.protocol import HoldStep, Protocol, SpinStep, Step, named_protocol
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.simulation import Truth

Array = npt.NDArray[np.float64]
RATE, TURN = np.radians(60.0), 2.0 * np.pi
HOLD, REST = 10.0, 6.0
# Every element differs from its mirror image; no rotation joins the triads' axes but their own.
MODEL = ImuModel(
    Triad(
        np.array([[1.02, 0.003, -0.004], [0.0031, 0.97, 0.002], [-0.0012, 0.0045, 1.05]]),
        np.array([0.02, -0.03, 0.05]),
    ),
    Triad(
        np.array([[0.99, 0.0021, -0.0033], [-0.0014, 1.03, 0.0026], [0.0037, -0.0018, 0.97]]),
        np.array([1e-3, -2e-3, 3e-3]),
    ),
)


def short(name: str, site: Site) -> Protocol:
    """A table's named protocol in less time: shorter holds, and one revolution of 60°/s each."""

    def changed(step: Step) -> Step:
        if isinstance(step, SpinStep):
            sign = float(np.sign(step.rate))
            return replace(step, duration=TURN / RATE - step.ramp, rate=sign * RATE, angle=sign * TURN)
        if isinstance(step, HoldStep):
            return replace(step, duration=REST if step.name.startswith("about") else HOLD)
        return step

    protocol = named_protocol(name)
    return replace(protocol, steps=tuple(changed(step) for step in protocol.steps), site=site)


def jointly(session: Session, *, optional_terms: bool = True) -> Estimate:
    """The joint estimate with a clock that is right."""
    session.options = Options(optional_terms=optional_terms)
    return calibrate(session, find_procedure("joint"), clocked=False)


def entry(model: ImuModel, name: str) -> float:
    """The entry of a model that an estimate's canonical name stands for; an absent term is zero."""
    triad, _, rest = name.partition(".")
    key, _, index = rest.rstrip("]").partition("[")
    value = model.g_sensitivity if key == "g_sensitivity" else getattr(getattr(model, triad), key)
    return 0.0 if value is None else float(value[tuple(int(i) for i in index.split(","))])


def normalised(estimate: Estimate, truth: Truth) -> Array:
    """Error over standard uncertainty of what the frame leaves free; a bias against its mean over the recording."""
    true = truth.model if estimate.frame == "fixture" else change_frame(truth.model, estimate.frame)
    wandered = {"accelerometer": truth.mean_wander[0], "gyroscope": truth.mean_wander[1]}
    error = [entry(estimate.model, name) - entry(true, name) for name in estimate.names]
    for k, name in enumerate(estimate.names):
        triad, _, rest = name.partition(".")
        error[k] -= float(wandered[triad][int(rest[-2])]) if rest.startswith("bias") else 0.0
    sigma = np.sqrt(np.diag(estimate.covariance))
    return np.array(error)[sigma > 0.0] / sigma[sigma > 0.0]
