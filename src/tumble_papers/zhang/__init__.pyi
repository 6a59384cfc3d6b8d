from .closed_forms import ellipsoid_from_norms as ellipsoid_from_norms
from .navigation import NAVIGATION as NAVIGATION
from .pose_sets import (
    GRAVITY as GRAVITY,
    POSE_SETS as POSE_SETS,
    chatfield_orientations as chatfield_orientations,
    find_best_on_sphere as find_best_on_sphere,
    find_best_subset as find_best_subset,
    paper_nine as paper_nine,
    predict_sigma as predict_sigma,
)
from .tables import TABLES_AND_FIGURES as TABLES_AND_FIGURES, theory_of_nine as theory_of_nine
from .turntable import (
    CHOICES as CHOICES,
    Setting as Setting,
    evaluate as evaluate,
    in_paper_units as in_paper_units,
    simulate as simulate,
    table_setting as table_setting,
    triad_parameters as triad_parameters,
)
