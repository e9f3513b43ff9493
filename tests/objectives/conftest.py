from field_fixtures import calibrated, parts, runner

__all__ = ["calibrated", "parts", "runner"]
