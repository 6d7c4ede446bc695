"""Trained policies as files that need none of this package: an ONNX graph, a C header, and their contract."""

from training.export.contract import Contract, contract_of
from training.export.write import export_policy

__all__ = ["Contract", "contract_of", "export_policy"]
