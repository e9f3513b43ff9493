from archive_fixtures import build_archive, made

__all__ = ["build_archive", "made"]
