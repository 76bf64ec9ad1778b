"""The full model: the A-frame as rigid finite elements (rfe) joined by spring-damping elements (sde)."""
