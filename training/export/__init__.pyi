from .contract import Contract, contract_of
from .write import export_policy

__all__ = ["Contract", "contract_of", "export_policy"]
