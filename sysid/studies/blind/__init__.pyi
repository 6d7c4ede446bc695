from .cases import BlindTests, Case

__all__ = ["BlindTests", "Case"]
