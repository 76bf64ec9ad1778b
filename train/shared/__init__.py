"""What the commands share: options, run folders, jobs, tables."""
