"""Measurements: files of recordings and poses, and the motion behind them."""
