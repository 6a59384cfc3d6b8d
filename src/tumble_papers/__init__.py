"""The papers' tables and figures made anew: studies of many simulated tests, beside the printed numbers.

Only what the papers print is stored (`tumble_papers.published`); every number of ours is computed when a
study runs.
"""
