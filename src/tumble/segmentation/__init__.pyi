from .activity import (
    Activity as Activity,
    find_activity as find_activity,
    follow_activity as follow_activity,
    noise_per_sample as noise_per_sample,
)
from .averages import mean_covariance as mean_covariance
from .blocks import BlockCut as BlockCut, Blocks as Blocks, TriadBlocks as TriadBlocks
from .creep import find_other_rests as find_other_rests
from .matching import (
    MatchedHold as MatchedHold,
    MatchedSpin as MatchedSpin,
    Matching as Matching,
    match_protocol as match_protocol,
    observe_matched_spins as observe_matched_spins,
)
from .observations import HoldMeans as HoldMeans, model_means as model_means, observe_holds as observe_holds
from .rest_wander import RestParts as RestParts, find_density as find_density, observe_parts as observe_parts
from .rotations import Rotation as Rotation, observe_rotations as observe_rotations
from .rounding import (
    carries_remainder as carries_remainder,
    converter_step as converter_step,
    integral_variance as integral_variance,
    rounding_of_each as rounding_of_each,
    rounding_variance as rounding_variance,
    step_at_rests as step_at_rests,
)
from .search import (
    MINIMUM_HOLD as MINIMUM_HOLD,
    find_timeline as find_timeline,
    read_intervals as read_intervals,
    search_blocks as search_blocks,
)
from .spin_means import SpinMeans as SpinMeans, whole_revolutions as whole_revolutions
from .thermal_rests import find_thermal_timeline as find_thermal_timeline
from .timeline import (
    Hold as Hold,
    NoiseFloor as NoiseFloor,
    Rejection as Rejection,
    Timeline as Timeline,
    Turn as Turn,
)
from .turns import (
    LONGEST_GAP as LONGEST_GAP,
    LONGEST_HARMLESS_GAP as LONGEST_HARMLESS_GAP,
    find_turns as find_turns,
)
