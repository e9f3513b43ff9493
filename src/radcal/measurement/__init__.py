"""The measured image: read or made, checked against the scene, turned into targets."""
