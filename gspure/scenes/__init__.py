"""Ray-traced scenes and their photographs."""
