"""Certifying a controller: fixed episodes on many plants, metrics with intervals, pass or fail.

plants       the variants of the robot that it is played on
run          what is played, and the certificate of the results
warning      success against warning time
thresholds   what a controller must reach
judge        metrics against thresholds
certificate  the content of a certificate, and its JSON file
report       a certificate as text and as an HTML page
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from training.certify.certificate import Certificate, read_certificate, write_certificate
    from training.certify.plants import RobotVariant, robot_variants, select_variants
    from training.certify.report import certificate_table, write_certificate_page
    from training.certify.run import Options, certify
    from training.certify.thresholds import Thresholds
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "Certificate",
    "Options",
    "RobotVariant",
    "Thresholds",
    "certificate_table",
    "certify",
    "read_certificate",
    "robot_variants",
    "select_variants",
    "write_certificate",
    "write_certificate_page",
]
