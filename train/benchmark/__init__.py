"""The tasks' benchmark: every policy's share of what is achievable, and the leaderboard that others add to."""
