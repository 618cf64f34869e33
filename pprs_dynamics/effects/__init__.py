"""Physical effects: each gives its share of the drive forces. One file per effect."""
