"""Results, pictures and notes of ``train.drives``."""
