"""What a person sees of long work under way."""
