"""Who goes where: paths, road users, how they drive, where that puts them."""
