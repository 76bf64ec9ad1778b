"""Active heave compensation of a load under an offshore A-frame crane."""
