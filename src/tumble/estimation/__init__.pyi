from .alternatives import Alternative as Alternative, Found as Found, Suspect as Suspect, find as find
from .balance import (
    CHANCE as CHANCE,
    ROUNDS as ROUNDS,
    SETTLED as SETTLED,
    Balanced as Balanced,
    ChainFactor as ChainFactor,
    Component as Component,
    Noise as Noise,
    Outlier as Outlier,
    Screen as Screen,
    balance as balance,
    gross_errors as gross_errors,
    noise_ratio as noise_ratio,
)
from .chain import (
    Chain as Chain,
    Eliminated as Eliminated,
    Place as Place,
    Spread as Spread,
    Stretch as Stretch,
)
from .crossing import crossing as crossing
from .equations import (
    Drift as Drift,
    Equations as Equations,
    Grouped as Grouped,
    Linear as Linear,
    Tests as Tests,
    View as View,
)
from .gauss_helmert import (
    Adjustment as Adjustment,
    Conditions as Conditions,
    Linearisation as Linearisation,
    Prior as Prior,
    adjust as adjust,
    invert_normal_matrix as invert_normal_matrix,
)
from .influence import (
    BENT as BENT,
    OUTLYING as OUTLYING,
    PRIOR as PRIOR,
    Influences as Influences,
    influences_of as influences_of,
)
from .reliability import (
    ALPHA as ALPHA,
    POWER as POWER,
    WeakDirection as WeakDirection,
    find_weak_directions as find_weak_directions,
    snoop_groups as snoop_groups,
    undetected as undetected,
)
from .solve import Settled as Settled, linearise as linearise, settled_at as settled_at, solve as solve
from .sums import Whitened as Whitened
from .unknowns import Block as Block, Layout as Layout, Unknowns as Unknowns
from .wander import (
    covariance_about_the_mean as covariance_about_the_mean,
    faster_variance as faster_variance,
    first_of_neighbours as first_of_neighbours,
    wander_basis as wander_basis,
    wider as wider,
)
