"""Files that `hexapod controller new` writes: a controller that walks, and its test."""
