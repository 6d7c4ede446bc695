"""What is odd in a run without being an error."""

from __future__ import annotations

from sysid.logs.records import Finding, Run


def run_findings(run: Run) -> list[Finding]:
    """Return what was noticed in one run."""
    return []
