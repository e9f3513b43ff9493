from field_fixtures import parts

__all__ = ["parts"]
