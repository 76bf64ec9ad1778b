"""What deep water and heavy ropes do to control."""
