"""The methods that ours is compared with, each as a whole labeler (paper IV-B)."""
