"""A live viewer in the browser: a lift in a sea, under a policy, beside the same lift with the drum still."""
