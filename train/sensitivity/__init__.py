"""How policies take it when things are not what they were told."""
