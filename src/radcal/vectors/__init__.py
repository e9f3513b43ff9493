"""Materials and objects from vector features, by a mapping that users edit."""
