"""Measured minus modelled effort, in time and in frequency, and its noise."""
