"""What a real drone needs before its control loop begins: a pass of a rehearsal, a quick bus."""
