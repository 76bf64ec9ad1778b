"""Open-loop drives: as functions of time, optimised for a scenario, stored in a map, and followed by a policy."""
