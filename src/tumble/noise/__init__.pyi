from .advice import seconds_needed as seconds_needed
from .autoregression import choose_order as choose_order
from .channel import Channel as Channel
from .characterisation import (
    COLLAPSE as COLLAPSE,
    Characterisation as Characterisation,
    characterise as characterise,
    characterise_blocks as characterise_blocks,
    triad_terms as triad_terms,
)
from .deviation import (
    Deviation as Deviation,
    StreamedDeviation as StreamedDeviation,
    allan_deviation as allan_deviation,
)
from .fitting.fit import MISSED as MISSED, NoiseFit as NoiseFit, Term as Term, fit_curve as fit_curve
from .fitting.weighted_fit import Method as Method
from .flicker import (
    flicker_corners as flicker_corners,
    flicker_recursions as flicker_recursions,
    flicker_variance as flicker_variance,
)
from .lines import find_lines as find_lines
from .terms import GaussMarkov as GaussMarkov, Line as Line, NoiseModel as NoiseModel
from .units import (
    ACCELEROMETER as ACCELEROMETER,
    GYRO as GYRO,
    practical_noise_unit as practical_noise_unit,
    si_noise_unit as si_noise_unit,
)
from .variances import LETTERS as LETTERS
