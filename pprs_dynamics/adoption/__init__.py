"""Adding an effect to a model: fit, objections, and the loop."""
