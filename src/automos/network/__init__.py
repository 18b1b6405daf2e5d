"""III-E: LMNet, a network that separates moving from static points online, from one scan and those before it.

Pure parts on arrays (projection, residuals, augmentation, clean-up) need nothing beyond the core; the network itself
needs PyTorch, or a runtime for exported networks.
"""
