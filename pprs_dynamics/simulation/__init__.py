"""The physics-engine robot and its hidden effects; shares only numbers with the model."""
