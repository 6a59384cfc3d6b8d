from .navigation import NAVIGATION as NAVIGATION
from .pose_sets import POSE_SETS as POSE_SETS, paper_nine as paper_nine, predict_sigma as predict_sigma
from .tables import TABLES_AND_FIGURES as TABLES_AND_FIGURES
from .turntable import evaluate as evaluate, simulate as simulate, table_setting as table_setting
