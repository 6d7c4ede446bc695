"""The paper's experiments on a target system, with its methods and ours."""
