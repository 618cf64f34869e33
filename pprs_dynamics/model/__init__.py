"""The drive model: the sum over effects, its limits and its file."""
