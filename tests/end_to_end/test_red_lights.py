"""A capture of which one pose is wrong, through the workflow: what its red light says is wrong is not released as good."""
