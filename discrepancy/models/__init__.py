"""Models with their libraries of effects: each a description, one function, and the physics it may have left out."""
