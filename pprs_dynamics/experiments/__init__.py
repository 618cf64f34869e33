"""Experiments: which motion would tell what the recordings leave open."""
