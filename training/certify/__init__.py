"""Certifying a controller: fixed episodes on many plants, figures with intervals, pass or fail.

plants   the robots that it is played on
run      what is played, and the certificate that comes of it
warning  success against warning time
figures  from episodes to figures
judge    figures against thresholds
records  what a certificate holds
codec    a certificate as a file
table    a certificate as text
page     a certificate as one HTML page
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from training.certify.certificate import Certificate, read_certificate, write_certificate
    from training.certify.plants import NamedPlant, select
    from training.certify.report import certificate_table, write_certificate_page
    from training.certify.run import Options, certify
    from training.certify.thresholds import Thresholds
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "Certificate",
    "NamedPlant",
    "Options",
    "Thresholds",
    "certificate_table",
    "certify",
    "read_certificate",
    "select",
    "write_certificate",
    "write_certificate_page",
]
