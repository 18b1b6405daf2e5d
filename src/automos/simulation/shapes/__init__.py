"""What things look like to a beam: meshes with materials."""
