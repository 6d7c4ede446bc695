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

from training.certify.codec import read_certificate, write_certificate
from training.certify.page import write_certificate_page
from training.certify.plants import NamedPlant, plants, select
from training.certify.records import Certificate, Thresholds
from training.certify.run import Options, certify
from training.certify.table import certificate_table

__all__ = [
    "Certificate",
    "NamedPlant",
    "Options",
    "Thresholds",
    "certificate_table",
    "certify",
    "plants",
    "read_certificate",
    "select",
    "write_certificate",
    "write_certificate_page",
]
