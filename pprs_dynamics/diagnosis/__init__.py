"""Model against measurement: how large the error is, where it sits, and what noise explains."""
