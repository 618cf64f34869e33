"""Selection of the missing effects: candidates, criterion, search."""
