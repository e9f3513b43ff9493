"""What stands on the ground: faces of boxes, double bounce along their foot, cross-sections from external codes."""
