"""III-E: LMNet learns from labels and runs online; what joins the network to recordings, poses and worlds."""
