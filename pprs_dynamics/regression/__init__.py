"""Columns of the regression, and the joint fit of all drives under coloured noise."""
