"""The thermal procedure: how biases, scale factors and angles change with temperature."""
