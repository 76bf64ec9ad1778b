"""The physics, and nothing but physics."""
