"""Findings as tables and pictures."""
