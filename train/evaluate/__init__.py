"""The comparison of policies on the same held-out scenarios."""
