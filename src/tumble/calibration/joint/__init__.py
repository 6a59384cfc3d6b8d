"""The joint estimator: one maximum-likelihood adjustment of everything that was recorded."""
