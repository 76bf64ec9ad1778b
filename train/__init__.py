"""Commands: python -m train.ppo, train.drives, ..."""
