"""What the drive map is held against, and how that is written."""
