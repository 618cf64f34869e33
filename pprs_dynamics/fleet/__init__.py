"""Many recordings of many robots: surveys into a store, and trends out of it."""
