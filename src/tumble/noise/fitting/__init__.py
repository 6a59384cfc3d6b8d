"""A model of noise fitted to Allan variances: their covariance, which terms, their limits, what is not told apart."""
