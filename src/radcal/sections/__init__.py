"""The sections of a case file: one model of pydantic a section, with types, limits, defaults and descriptions."""
