"""The steps of the strapdown rotation test: sequences as they were recorded, errors, the estimate of them."""
