"""Pictures of recordings and labels."""
